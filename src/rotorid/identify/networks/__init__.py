"""Neural networks from first principles, as the thesis writes them (chapter 4.2)."""
