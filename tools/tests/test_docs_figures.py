# SPDX-FileCopyrightText: Copyright 2026 The TurboMap authors
# SPDX-License-Identifier: Apache-2.0
"""That figures of the documentation can be printed again. README.md and docs/comparison.md show none of ours but those of a page that
tools/evaluate.py wrote, with a link to it, or such as stand beside their command; what is said above such a page's tables is in them, or in a section
that the paragraph links to; each section of docs/performance.md that has a table names a command, and below those tables each of docs/evaluation.md,
or the section that it is part of."""

import csv
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FIGURE = re.compile(r"(\d[\d,.]*\d|\d)\s?(?:ms|us|s|seconds?|min|minutes?|hours?|x|times|%|mm|cm|[KMG]B)(?![\w-])")
COMMAND = re.compile(r"(?:^|\s)(?:turbomap-[a-z-]+|(?:\./)?(?:tools|tests)/\S+|\./quickstart|g\+\+|nvcc|cmake)\s+\S")  # a program and an argument
OF_OTHERS = ("Figures of theirs", "Sources")  # sections of docs/comparison.md


def has_command(text):
    return bool(re.search(r"^    \S", text, re.MULTILINE) or any(COMMAND.search(span) for span in re.findall("`([^`]*)`", text)))


def sections(text):
    """(title, body), the body without that of the sections below it."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    parts = re.split(r"^#+ (.*)$", text, flags=re.MULTILINE)
    return list(zip(parts[1::2], parts[2::2]))


def linked_section(page, anchor):
    """What stands under the heading that a link's anchor names, with the sections below it; without an anchor the whole page."""
    text = re.sub(r"^```.*?^```", "", (ROOT / "docs" / page).read_text(), flags=re.MULTILINE | re.DOTALL)
    for heading in re.finditer(r"^(#+) (.*)$", text, flags=re.MULTILINE):
        if re.sub(r"[^\w -]", "", heading.group(2).lower()).replace(" ", "-") == anchor:
            rest = text[heading.end():]
            end = re.search(rf"^#{{1,{len(heading.group(1))}}} ", rest, flags=re.MULTILINE)
            return rest[:end.start()] if end else rest
    return "" if anchor else text


def evaluated(page):
    """All numbers of a page that tools/evaluate.py wrote."""
    with open((ROOT / "docs" / page).with_suffix(".csv"), newline="") as file:
        return {number for row in csv.DictReader(file) for number in re.findall(r"\d[\d.,]*\d|\d", row["value"])}


def without_source(text):
    """Lines with a figure that nothing prints."""
    bad = []
    for title, body in sections(text):
        for line in body.split("\n") if title not in OF_OTHERS else ():
            figures = FIGURE.findall(line)
            pages = re.findall(r"\((?:docs/)?(evaluation(?:_h200)?\.md)", line)
            known = set().union(*(evaluated(page) for page in pages))
            if figures and not has_command(line) and not set(figures) <= known:
                bad.append(line)
    return bad


def not_in_the_tables(text, known):
    """Paragraphs above the tables that tools/evaluate.py wrote with a figure that is neither known nor in what they link to."""
    bad = []
    for paragraph in text.partition("<!-- evaluate: begin -->")[0].split("\n\n"):
        linked = {n for page, anchor in re.findall(r"\((\w+\.md)#?([\w-]*)", paragraph)
                  for n in re.findall(r"\d[\d.,]*\d|\d", linked_section(page, anchor))}
        if set(FIGURE.findall(paragraph)) - known - linked:
            bad.append(paragraph)
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
        judged = (ROOT / "docs/evaluation.md").read_text().partition("<!-- evaluate: end -->")[2]
        self.assertEqual(parts_without_command(judged), [])
        for words in ("no command prints", "patched"):
            self.assertNotIn(words, text)

    def test_what_is_said_of_the_tables(self):
        for page in ("evaluation.md", "evaluation_h200.md"):
            self.assertEqual(not_in_the_tables((ROOT / "docs" / page).read_text(), evaluated(page)), [], page)
        end = "\n\n<!-- evaluate: begin -->\n77 ms"
        self.assertEqual(not_in_the_tables("# T\n\nIt takes 5.5 ms." + end, {"5.5"}), [])
        self.assertEqual(not_in_the_tables("# T\n\nIt takes 5.4 ms." + end, {"5.5"}), ["It takes 5.4 ms."])
        there, elsewhere = (set(re.findall(r"\d+\.\d+", linked_section("evaluation.md", anchor)))
                            for anchor in ("speed-ups-over-the-peer", "summary"))
        only_there = min(there - elsewhere)
        linked = f"See [it](evaluation.md#{{}}): {only_there} times."
        self.assertEqual(not_in_the_tables(linked.format("summary") + end, set()), [linked.format("summary")])
        self.assertEqual(not_in_the_tables(linked.format("speed-ups-over-the-peer") + end, set()), [])

    def test_figures_are_found(self):
        known = next(n for n in sorted(evaluated("evaluation.md")) if "." in n)
        for line in ("It takes 22.5 ms.", "14x as fast", "Errors are 30 % lower", f"{known} ms", "It took 18 minutes.",
                     "On `x`, g++ 12 `-O3`, it takes 7.5 ms", "`turbomap-replay` takes 7.5 ms", "`a/tests/b c`: 7.5 s", "See [it](evaluation.md): 123456.789 ms"):
            self.assertEqual(without_source(f"# T\n{line}\n"), [line])
        for line in ("two keyframes, 1 m apart", "C++17", "CMake 3.22", f"[that](evaluation.md#a): {known} ms", "22.5 ms: `turbomap-replay RECORDING`"):
            self.assertEqual(without_source(f"# T\n{line}\n"), [])
        self.assertEqual(without_source("# Figures of theirs\n41 times\n"), [])

    def test_sections_without_a_command_are_found(self):
        table = "| a | ms |\n|---|---|\n| b | 3 |\n"
        self.assertEqual(without_command(f"# P\n## A\n{table}## B\nBy `turbomap-bench --policy\nomp`:\n{table}"), ["A"])
        self.assertEqual(parts_without_command(f"## A\n### B\n{table}## C\nBy `turbomap-bench --policy omp`\n### D\n{table}"), ["B"])


if __name__ == "__main__":
    unittest.main()
