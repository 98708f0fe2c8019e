"""The manual's page of messages: all that the code says is on it, each with a remedy."""

import ast
import re

import pytest

from packed import messages

pytestmark = pytest.mark.once


def test_the_page_is_the_codes_and_every_message_has_a_remedy():
    assert messages.problems() == []


CODE = '''
"""A module that says a few things."""
_SENTENCE = "Things are left out: {}; add them"
LABEL = "Max Bounces"

def tell(report, name, count):
    """Say what is wrong with a thing of this name."""
    log.info("This is for the log alone, nobody reads it")
    report.note(f"Mesh '{name}' has {count} holes: repair it", name)
    if count > 3:
        raise ExportError("The scene has no camera: " + "add one")
    raise ImageError("is empty or cannot be read here")

class Panel:
    value: IntProperty(name="Value", description="This is a tooltip of some length, no message")
'''


def test_every_message_that_a_page_shows_is_said():
    """Lines of a panel or a log, as pages of the manual show them, behind a bullet."""
    patterns = [
        re.compile(re.escape(message.text).replace("…", ".*") + ".*")
        for message in messages.messages()
    ]
    shown = [
        (page.name, line.removeprefix("• "))
        for page in messages.PAGE.parent.glob("*.md")
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("• ")
    ]
    unknown = [(page, line) for page, line in shown if not any(p.fullmatch(line) for p in patterns)]
    assert shown and not unknown


def test_every_message_that_a_page_quotes_is_said():
    """In backticks behind what is filled in, and in quotation marks where something is looked
    up.
    """
    said = {part for message in messages.messages() for part in message.text.split("…")}
    pages = {
        page.name: page.read_text(encoding="utf-8") for page in messages.PAGE.parent.glob("*.md")
    }
    quoted = [words for page in pages.values() for words in re.findall("`… ([^`]+)`", page)]
    quoted += re.findall(r'"([^"\n]+ [^"\n]+)"', pages["troubleshooting.md"])
    unknown = [words for words in quoted if not any(words in part for part in said)]
    assert len(quoted) > 2 and not unknown


def texts(path):
    return sorted(set(messages._texts(path, ast.parse(CODE))))


def test_what_is_said_is_found_wherever_it_stands():
    told = ["Mesh … has … holes: repair it", "The scene has no camera:"]
    assert texts("operators/module.py") == told
    assert texts("addon/export/module.py") == [*told, "Things are left out: …; add them"]


@pytest.mark.parametrize(
    ("text", "said", "remedy"),
    [
        ("Things are left out: …; add them", "Things are left out: …", "Add them"),
        ("The camera: it is gone", "The camera: it is gone", ""),
        ("The comparison was stopped", "The comparison was stopped", "Nothing: Esc was pressed"),
    ],
)
def test_a_remedy_is_the_messages_own_or_the_tables(text, said, remedy):
    assert messages.Message("The render", text).split == (said, remedy)


def test_the_cores_sentences_are_found_across_lines():
    source = """
#include "a file of three words"
// "a comment that is long enough"
static_assert(sizeof(int) == 4, "this machine is too small");
report.add(good, "geometry %llu: strands need "
           "a radius for %u", number);
report.add(good, "short");
"""
    assert messages.core_texts(source) == ["geometry …: strands need a radius for …"]
    assert len(messages.core_messages()) > 100


def test_a_new_message_without_a_remedy_is_told(monkeypatch):
    monkeypatch.setattr(messages, "REMEDIES", {"Nobody says this": "Wait"})
    lines = messages.problems()
    assert any("no remedy for 'The comparison was stopped'" in line for line in lines)
    assert any("nothing says 'Nobody says this'" in line for line in lines)
    assert any("is stale" in line for line in lines)
