"""The core rules of YAML 1.2, as two tables, and JSON as the part of YAML whose meaning is beyond doubt."""

import json
import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from bfi_cli.errors import ConfigError, DictionaryError
from bfi_cli.yaml12 import load_yaml

TEXT = st.text(
    st.characters(exclude_categories=["Cc", "Cs", "Cn", "Co", "Zl", "Zp"], exclude_characters="\ufeff"), max_size=20
)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | TEXT,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=4),
    max_leaves=12,
)


@pytest.mark.slow
@given(JSON)
def test_json_is_yaml(data):
    read = load_yaml(json.dumps(data, ensure_ascii=False))
    assert read == data
    assert json.dumps(read) == json.dumps(data)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        *[(word, None) for word in ("", "~", "null", "Null", "NULL")],
        *[(word, True) for word in ("true", "True", "TRUE")],
        *[(word, False) for word in ("false", "False", "FALSE")],
        *[(word, word) for word in ("yes", "no", "on", "off", "y", "n", "Yes", "NO", "tRue", "nULL")],
        *[("0", 0), ("12", 12), ("-3", -3), ("+4", 4), ("012", 12), ("0o17", 15), ("0x1F", 31), ("0x1f", 31)],
        *[("1e-3", 0.001), ("1E3", 1000.0), ("1.", 1.0), (".5", 0.5), ("-.5e+2", -50.0), ("6.02e23", 6.02e23)],
        *[(".inf", math.inf), ("-.Inf", -math.inf), ("+.INF", math.inf)],
        *[
            (word, word)
            for word in ("12:30:00", "190:20:30.15", "1_000", "0b101", "-0x1", "2024-01-31", "1e", "e3", "+")
        ],
        *[(word, word) for word in ("=", "<<", ".", "0o8", "inf", "nan")],
        *[("'1'", "1"), ('"no"', "no"), ("!!str 5", "5"), ("!!float 1", 1.0), ("!!int 3", 3)],
        ("<<: {a: 1}", {"a": 1}),
        ("'<<': {a: 1}", {"<<": {"a": 1}}),
        ("x: &x {a: 1, b: 2}\ny: {b: 3, <<: *x}", {"x": {"a": 1, "b": 2}, "y": {"a": 1, "b": 3}}),
        ("<<: [{a: 1}, {a: 2, b: 2}]\nc: 3", {"a": 1, "b": 2, "c": 3}),
        ("{a: &x 1, b: *x}", {"a": 1, "b": 1}),
    ],
)
def test_scalars(text, value):
    read = load_yaml(text)
    assert read == value
    assert type(read) is type(value)


def test_not_a_number_is_a_number():
    assert all(math.isnan(load_yaml(word)) for word in (".nan", ".NaN", ".NAN"))


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a: 1\nb:\n  c: 2\n  c: 3", "line 4, column 3: key 'c' stands twice; keep one"),
        ("a: [1", "line 1, column 6: expected ',' or ']'"),
        ("a: b: c", "line 1, column 5: mapping values are not allowed here"),
        ("a: 1\n\tb: 2", "line 2, column 1: found character"),
        ("a\n---\nb", "line 2, column 1: but found another document"),
        ("&a [*a]", "line 1, column 5: alias 'a' stands in its own value; write it out"),
        ("*a", "line 1, column 1: found undefined alias 'a'"),
        ("{[1]: 2}", "line 1, column 2: a key must be a plain word"),
        ("a: !!int abc", "line 1, column 4: 'abc' is not of type int"),
        ("a: !!python/name:os.system x", "line 1, column 4: unknown tag 'python/name:os.system'"),
        ("!!timestamp x", "unknown tag 'timestamp'"),
        ("!!seq x", "not a list"),
        ("a: 1\n<<: 2", "line 2, column 5: '<<' merges mappings; write <<: *name or <<: [*a, *b]"),
        ("<<: {a: 1}\n<<: {b: 1}", "line 2, column 1: key '<<' stands twice; give it a list, <<: [*a, *b]"),
        ("!!map x", "not a mapping"),
        ("9" * 5000, "a whole number of 5000 digits; give one of at most 50"),
        ("a: 1\nb: \x07", "line 2, column 4: a character YAML does not allow"),
        ("[" * 1200, "nested too deeply"),
    ],
)
def test_texts_that_are_refused(text, complaint):
    with pytest.raises(ConfigError) as refusal:
        load_yaml(text, where="my.yaml")
    assert str(refusal.value).startswith("my.yaml: ")
    assert complaint in str(refusal.value)
    assert "\n" not in str(refusal.value)


def complaint_about(text):
    """Return the complaint about a text, "" where it is YAML; any other exception fails the test."""
    try:
        load_yaml(text)
    except ConfigError as refusal:
        return str(refusal)
    return ""


@given(st.text(st.sampled_from("ab1 :-[]{},&*!?|>'\"%#\n\t.~<"), max_size=30) | st.text(max_size=20))
def test_any_text_is_data_or_one_line_of_complaint(text):
    assert "\n" not in complaint_about(text)


def test_files(tmp_path):
    file = tmp_path / "a.yaml"
    file.write_bytes("\ufeffa: 1e-3 # µ".encode())
    assert load_yaml(file) == {"a": 0.001}
    file.write_bytes(b"a: \xff")
    with pytest.raises(DictionaryError, match=r"a\.yaml: byte 3 is not UTF-8 text"):
        load_yaml(file, error=DictionaryError)
    for path, complaint in [
        (tmp_path / "none.yaml", "none.yaml: cannot be read, no such file"),
        (tmp_path, "directory"),
    ]:
        with pytest.raises(ConfigError, match=complaint):
            load_yaml(path)


@pytest.mark.parametrize(
    ("text", "n_values"),
    [("a", 1), ("[1, 2]", 3), ("{a: 1}", 3), ("[&a [1, 2], *a]", 7), ("[&a [1], &b [*a, *a], *b, *b]", 18)],
)
def test_values_are_counted_as_if_aliases_were_written_out(text, n_values, monkeypatch):
    monkeypatch.setattr("bfi_cli.yaml12.MAX_VALUES", n_values)
    load_yaml(text)
    monkeypatch.setattr("bfi_cli.yaml12.MAX_VALUES", n_values - 1)
    with pytest.raises(ConfigError, match=f"more than {n_values - 1} values; "):
        load_yaml(text)


@pytest.mark.skipif(not yaml.__with_libyaml__, reason="PyYAML without libyaml")
@pytest.mark.parametrize(
    "text",
    [
        "a: 1e-3\nb: no\nc: 12:30:00\nd: 0o17\ne: .inf\nf: ~\ng:\nh: ''\n",
        "x: &n {a: 1}\ny: {<<: *n, b: 2}\nz: ['<<', \"<<\"]\n",
        "- |\n  two\n  lines\n- >-\n  one\n  line\n- 'it''s'\n- \"\\u00e9\"\n",
        "é: [1, 2.5, true, nUll]\n",
    ],
)
def test_libyaml_reads_the_same(text: str, monkeypatch: pytest.MonkeyPatch):
    quick = load_yaml(text)
    monkeypatch.setattr(yaml, "__with_libyaml__", False)
    assert repr(load_yaml(text)) == repr(quick)
