# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""That figures of the documentation can be printed again. A figure of a table that tools/evaluate.py wrote is the text of a link to that table,
and stands there in a row that is named beside it; a sentence with such a link has no other number, nor has what is said above those tables.
README.md and docs/comparison.md show no other figures of ours but beside a command; each section of docs/performance.md that has a table names
a command, and below the tables of docs/evaluation.md each, or the section that it is part of."""

import pathlib
import re
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tools"))
import evaluate  # noqa: E402

FIGURE = re.compile(r"(\d[\d,.]*\d|\d)\s?(?:ms|us|s|seconds?|min|minutes?|hours?|x|times|%|mm|cm|[KMG]B)(?![\w-])")
COMMAND = re.compile(r"(?:^|\s)(?:turbomap-[a-z-]+|(?:\./)?(?:tools|tests)/\S+|\./quickstart|g\+\+|nvcc|cmake)\s+\S")  # a program and an argument
OF_OTHERS = ("Figures of theirs", "Sources")  # sections of docs/comparison.md
EVALUATED = ("evaluation.md", "evaluation_h200.md")
LINK = re.compile(r"\[([^]]*)\]\((?:docs/)?([\w-]+\.md)?(?:#([\w-]*))?\)")
NUMBER = re.compile(r"(?<![\w.+-])(\d+(?:[.,]\d+)*)(?![.,]?\d)(?:x\b|(?![\w-]))")  # not in names, dates, versions such as C++17
VERSION = re.compile(r"(?:g\+\+|clang\+\+|nvcc|CUDA|Zen|Python) \d[\d.]*")


def has_command(text):
    return bool(re.search(r"^    \S", text, re.MULTILINE) or any(COMMAND.search(span) for span in re.findall("`([^`]*)`", text)))


def without_code(text):
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return re.sub(r"<!--.*?-->", "", re.sub(r"`[^`]*`", "", re.sub(r"^    .*$", "", text, flags=re.MULTILINE)), flags=re.DOTALL)


def sections(text):
    """(title, body), the body without that of the sections below it."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    parts = re.split(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return list(zip(parts[1::2], parts[2::2]))


def anchor_of(title):
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


def written_tables():
    """{(page, anchor): table} of all that tools/evaluate.py wrote into pages."""
    return {(page, anchor_of(t.title)): t for page in EVALUATED for t in evaluate.read_csv((ROOT / "docs" / page).with_suffix(".csv"))}


def linked_section(page, anchor):
    """What stands under the heading that a link's anchor names, with the sections below it; without an anchor the whole page."""
    text = re.sub(r"^```.*?^```", "", (ROOT / "docs" / page).read_text(), flags=re.MULTILINE | re.DOTALL)
    for heading in re.finditer(r"^(#+) (.*)$", text, flags=re.MULTILINE):
        if anchor_of(heading.group(2)) == anchor:
            rest = text[heading.end():]
            end = re.search(rf"^#{{1,{len(heading.group(1))}}} ", rest, flags=re.MULTILINE)
            return rest[:end.start()] if end else rest
    return "" if anchor else text


def numbers_of(written, context):
    """All numbers of the rows whose keys stand in `context`, if one does, or of the whole table and its note."""
    named = [row for row in written.rows if all(part in context for part in row[0][0].split(", "))]
    by = [row for row in named if len(row[0]) > 1 and all(re.search(rf"(?<!\w){re.escape(k)}(?!\w)", context) for k in row[0][1:])]
    shown = [text for key, values in by or named or written.rows for text in (*key, *values.values())] + ([] if named else [written.note])
    return {n for text in shown for n in NUMBER.findall(text)}


def statements(text):
    """(sentence or cell of a table, the paragraph or row that it is in)"""
    for paragraph in re.split(r"\n\s*\n|\n(?=\||- |\d+\. )", without_code(text)):
        for sentence in paragraph.split("|") if paragraph.startswith("|") else re.split(r"(?<=[.:])\)?\s+", paragraph):
            yield sentence, paragraph


def wrong_figures(text, page, tables, strict=False):
    """Statements with a number that is the text of a link and is not in what is linked: of a table of `tables` in the rows that are named beside
    it. In statements with a link to such a table, and with strict in all, also each number that is not the text of a link."""
    bad = []
    for statement, context in statements(text):
        wrong, told = set(), strict
        for said, target, anchor in LINK.findall(statement):
            target = target or page
            written = tables.get((target, anchor))
            told = told or written
            numbers = set(NUMBER.findall(said))
            if numbers:
                wrong |= numbers - (numbers_of(written, context) if written else set(NUMBER.findall(linked_section(target, anchor))))
        rest = NUMBER.findall(VERSION.sub("", LINK.sub("", statement))) if told else []
        if wrong or rest:
            bad.append((" ".join(statement.split()), sorted(wrong), rest))
    return bad


def without_source(text):
    """Lines with a figure that neither stands beside its command nor in a link to a table, which wrong_figures() looks at."""
    bad = []
    for title, body in sections(text):
        for line in body.split("\n") if title not in OF_OTHERS else ():
            if FIGURE.search(re.sub(r"\[[^]]*\]\((?:docs/)?evaluation(?:_h200)?\.md#[^)]*\)", "", line)) and not has_command(line):
                bad.append(line)
    return bad


def without_command(text):
    """Sections with a table of figures and without a command."""
    titles = [title for title, body in sections(text) if re.search(r"^\|[^\n]*\d", body, re.MULTILINE) and not has_command(body)]
    return [title for title in titles if title != "At a glance"]  # whose rows link to the others


def parts_without_command(text):
    """The same of text whose sections (##) name the commands of their parts (###)."""
    bad = []
    for part in re.split(r"^(?=## )", text, flags=re.MULTILINE):
        if not has_command(re.split(r"^###", part, flags=re.MULTILINE)[0]):
            bad += without_command(part)
    return bad


class docs_figures(unittest.TestCase):
    def test_pages(self):
        for page in ("README.md", "docs/comparison.md"):
            self.assertEqual(without_source((ROOT / page).read_text()), [], page)
        text = (ROOT / "docs/performance.md").read_text()
        self.assertEqual(without_command(text), [])
        for page in EVALUATED:
            judged = (ROOT / "docs" / page).read_text().partition(evaluate.END)[2]
            self.assertEqual(parts_without_command(judged), [])
        for words in ("no command prints", "patched"):
            self.assertNotIn(words, text)

    def test_figures_of_the_tables(self):
        tables = written_tables()
        for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
            before, _, rest = path.read_text().partition(evaluate.BEGIN)
            bad = wrong_figures(before, path.name, tables, strict=path.name in EVALUATED) + wrong_figures(
                rest.partition(evaluate.END)[2], path.name, tables)
            self.assertEqual(bad, [], path.name)

    def test_wrong_figures_are_found(self):
        t = evaluate.table("Times, all", "Of 7 runs.", ["recording", "who"])
        t.add(["room", "seq"], {"total": "5.25 +- 1.50"})
        t.add(["room", "peer"], {"total": "60.0"})
        t.add(["hall", "seq"], {"total": "8.75"})
        tables = {("evaluation.md", "times-all"): t}
        link = "[{}](evaluation.md#times-all)"

        def wrong(text, **how):
            return wrong_figures(text, "other.md", tables, **how)

        for text in (link.format("8.75 ms"), "room takes " + link.format("5.25 and 60.0 ms"), "room by the peer: " + link.format("60.0"),
                     link.format("7 runs"), "The hall is fast. It takes " + link.format("8.75"), "| room | " + link.format("5.25") + " | 4 |",
                     "It takes 4 ms.", "`x 3`, g++ 12, 2026-11-01: " + link.format("8.75 ms")):
            self.assertEqual(wrong(text), [], text)
        for text in (link.format("8.76 ms"), "room takes " + link.format("8.75 ms"), "room by the peer: " + link.format("5.25"),
                     "Of 4 runs " + link.format("5.25") + " was least", "room: " + link.format("5.25 to 61.0 ms"), link.format("5.25, 7 or 4")):
            self.assertEqual(len(wrong(text)), 1, text)
        self.assertEqual(len(wrong("It takes 4 ms.", strict=True)), 1)
        self.assertEqual(len(wrong("It takes 16 of 18, room1 is C++17.", strict=True)), 1)
        self.assertEqual(wrong("room1 is C++17, of 2026-11-01, `-O3 4`.", strict=True), [])
        self.assertEqual(wrong_figures("[5.2](#times-all)", "evaluation.md", tables)[0][1], ["5.2"])

    def test_figures_are_found(self):
        for line in ("It takes 22.5 ms.", "14x as fast", "Errors are 30 % lower", "It took 18 minutes.", "On `x`, g++ 12 `-O3`, it takes 7.5 ms",
                     "`turbomap-replay` takes 7.5 ms", "`a/tests/b c`: 7.5 s", "See [it](evaluation.md#a): 123456.789 ms"):
            self.assertEqual(without_source(f"# T\n{line}\n"), [line])
        for line in ("two keyframes, 1 m apart", "C++17", "CMake 3.22", "[3 ms](docs/evaluation.md#a)", "22.5 ms: `turbomap-replay RECORDING`"):
            self.assertEqual(without_source(f"# T\n{line}\n"), [])
        self.assertEqual(without_source("# Figures of theirs\n41 times\n"), [])

    def test_sections_without_a_command_are_found(self):
        table = "| a | ms |\n|---|---|\n| b | 3 |\n"
        self.assertEqual(without_command(f"# P\n## A\n{table}## B\nBy `turbomap-bench --policy\nomp`:\n{table}"), ["A"])
        self.assertEqual(parts_without_command(f"## A\n### B\n{table}## C\nBy `turbomap-bench --policy omp`\n### D\n{table}"), ["B"])


if __name__ == "__main__":
    unittest.main()
