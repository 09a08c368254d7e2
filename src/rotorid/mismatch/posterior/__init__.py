"""One posterior over effects at work: most probable models, their log odds, and statements that follow from them."""
