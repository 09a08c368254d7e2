"""The drawing of the workflow's rules."""

from rotorid.report.plots.instruments import columns, heights, merged, reduced, rule_graph, wrapped

STEPS = [
    ("import_public_a", "fit"),
    ("import_public_b", "fit"),
    ("fit", "chapter_one"),
    ("import_public_a", "chapter_two"),
    ("chapter_one", "render_chapter"),
    ("chapter_two", "render_chapter"),
    ("render_chapter", "typeset_pdf"),
]


def test_a_rule_stands_right_of_what_it_reads_and_chapters_in_one_column() -> None:
    pairs = merged(STEPS)
    assert ("import_public", "fit") in pairs and len(pairs) == 6
    place = columns(pairs)
    assert all(place[a] < place[b] for a, b in pairs)
    assert place["chapter_one"] == place["chapter_two"] == 2


def test_what_a_longer_way_implies_is_not_drawn() -> None:
    assert reduced([("a", "b"), ("a", "c"), ("b", "c")]) == [("a", "b"), ("b", "c")]


def test_no_two_rules_stand_on_each_other() -> None:
    pairs = merged(STEPS)
    place = columns(pairs)
    height = heights(pairs, place)
    assert len({(place[rule], height[rule]) for rule in place}) == len(place)


def test_names_are_wrapped_and_all_drawn() -> None:
    assert wrapped("estimate_flight_inertias") == "estimate flight\ninertias"
    drawn = {text.get_text().replace("\n", " ") for text in rule_graph(STEPS).axes[0].texts}
    assert {"import public", "fit", "chapter one", "render chapter", "typeset pdf"} <= drawn
