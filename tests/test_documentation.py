"""What the documents name is there: modules in the maps, links, dotted names, verbs, the version."""

import ast
import dataclasses
import re
import sys
import tomllib
from pathlib import Path

import pytest
from conftest import BY_PLAIN, left_out
from plain_environment import needed

from docs import documented_commands, reference_pages
from geometry.design import Design
from studies.cli import commands
from studies.parts.requirements import LIMITS
from studies.quantities import QUANTITIES

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("geometry", "fem", "analytic", "studies")
DOCUMENTS = sorted(
    path
    for folder in (".", *PACKAGES, "docs", "results")
    for path in (ROOT / folder).glob("*.md" if folder == "." else "**/*.md")
    if not path.is_relative_to(documented_commands.REFERENCE)
)
HEADING = re.compile(r"^### `([\w.]+)`$")
ROW = re.compile(r"^\| `(\w+)` \|")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
DOTTED = re.compile(rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)+)`")

PATH = re.compile(rf"(?<![\w/.])((?:{'|'.join(PACKAGES)})/[\w/.]+)")


def name(path):
    return path.relative_to(ROOT).as_posix()


def prose(path):
    """The text without fenced blocks."""
    return re.sub(r"^( *)```.*?^\1```$", "", path.read_text("utf-8"), flags=re.M | re.S)


def mapped(text):
    """Modules that the section Map of a README names, by package."""
    stems, package = {}, None
    for line in text.partition("\n## Map\n")[2].partition("\n## ")[0].splitlines():
        if heading := HEADING.match(line):
            package = heading[1]
            stems[package] = []
        elif (row := ROW.match(line)) and package:
            stems[package].append(row[1])
    return stems


def modules(package):
    """Modules on disk by package."""
    stems = {}
    for path in (ROOT / package).rglob("*.py"):
        if path.stem != "__init__":
            stems.setdefault(".".join(path.parent.relative_to(ROOT).parts), []).append(path.stem)
    return stems


@pytest.mark.parametrize("package", PACKAGES)
def test_map_names_modules_that_exist(package):
    shown, there = mapped((ROOT / package / "README.md").read_text("utf-8")), modules(package)
    assert [stem for key, names in shown.items() for stem in names if stem not in there.get(key, ())] == []


def slug(heading):
    """The anchor of a heading, as it is made for pages: lower case, dashes for spaces, no other signs."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


def check_links(text, path):
    """Links of a document lead to files and headings, or to what is made when the site is built."""
    run = path in (documented_commands.PICTURES, *documented_commands.TUTORIALS)
    drawn = documented_commands.pictures(path) if run else ()
    for target in LINK.findall(text):
        if target.startswith(("http://", "https://")) or target in drawn:
            continue
        file, _, anchor = target.partition("#")
        goal = (path.parent / file).resolve() if file else path
        if goal.is_relative_to(documented_commands.REFERENCE):
            made = [*(f"reference/{page}.md" for page in reference_pages.PAGES), *reference_pages.DRAWINGS]
            assert goal.relative_to(reference_pages.DOCS).as_posix() in made, target
            continue
        assert goal.exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.+)$", prose(goal), flags=re.M)
            assert anchor in map(slug, headings), target


@pytest.mark.parametrize("path", DOCUMENTS, ids=name)
def test_links_lead_to_files_and_headings(path):
    check_links(prose(path), path)


@pytest.mark.parametrize(
    ("page", "names"),
    [
        ("design", [spec.name for spec in dataclasses.fields(Design)]),
        ("load", ["depth", "shear", "shear_y", "friction", "grip", "plate_tilt", "imperfection"]),
        ("quantities", QUANTITIES),
        ("requirements", LIMITS),
        ("verb/store", ["magtip store list", "magtip store prune"]),
        ("verb/decode", ["surrogate", "fem"]),
        ("python", ["Design", "solve", "answer"]),
    ],
)
def test_pages_of_the_reference_have_all_names_and_links(page, names):
    text = reference_pages.page(page)
    assert [name for name in names if not re.search(rf"^(\| |#+ )`?{name}`?( |$)", text, flags=re.M)] == []
    check_links(text, documented_commands.REFERENCE / f"{page}.md")


def defined(path):
    """Names that a module defines at its top."""
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        elif isinstance(node, ast.Assign):
            yield from (each.id for target in node.targets for each in ast.walk(target) if isinstance(each, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id


def resolves(dotted):
    """Whether a name leads to a package, a module, or something that a module defines."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        place = ROOT.joinpath(*parts[:count])
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if file.exists():
                return count == len(parts) or parts[count] in defined(file)
    return False


@pytest.mark.parametrize("path", [path for path in DOCUMENTS if path.name != "CHANGELOG.md"], ids=name)
def test_dotted_names_are_defined(path):
    """The changelog also names what was before, and so does no other document."""
    assert not [dotted for dotted in DOTTED.findall(path.read_text("utf-8")) if not resolves(dotted)]


@pytest.mark.parametrize("package", PACKAGES)
def test_names_and_paths_in_the_source_are_there(package):
    for path in (ROOT / package).rglob("*.py"):
        text = path.read_text("utf-8")
        assert not [dotted for dotted in DOTTED.findall(text) if not resolves(dotted)], name(path)
        assert not [file for file in PATH.findall(text) if not (ROOT / file.rstrip(".")).exists()], name(path)


def test_a_wrong_name_is_no_name():
    assert resolves("geometry.design.Design")
    assert resolves("fem.solve")
    assert not resolves("geometry.design.Desing")
    assert not resolves("geometry.designs")


def misplaced(text, module, names):
    """Words of a row of CONTRIBUTING that its module lacks, and names of the row that it does not define."""
    path = ROOT.joinpath(*module.split(".")).with_suffix(".py")
    source = path.read_text("utf-8")
    missing = re.findall(r"\b[A-Z]\w+|(?<=\").+(?=\")", text)
    missing = [word for word in missing if word not in " ".join(source.split())]
    here = {node.name for node in ast.walk(ast.parse(source)) if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    return missing + [name for name in names if name not in here]


def test_what_is_looked_for_runs_in_the_module_that_is_named():
    contributing = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    rows = re.findall(r"^\| ([^|`]+) \| `([\w.]+)` \| ([^|]+) \|$", contributing, flags=re.M)
    assert len(rows) == contributing.partition("| looking for |")[2].partition("\n\n")[0].count("\n") - 1
    for text, module, names in rows:
        assert misplaced(text, module, re.findall(r"`(\w+)`", names)) == [], module


def test_every_verb_has_a_row():
    text = (ROOT / "studies" / "README.md").read_text("utf-8")
    verbs = {verb for verb in commands.app if not verb.startswith("-")}
    assert verbs == set(re.findall(r"\| `magtip (\w+)[^|]*` \|$", text, flags=re.M))


def test_no_row_of_a_table_is_longer_than_two_lines():
    """Pages of results are made by their studies."""
    written = [path for path in DOCUMENTS if path.name == "README.md" or (ROOT / "docs") in path.parents]
    written = [path for path in written if not path.is_relative_to(ROOT / "results" / "sizing")]
    rows = [line for path in written for line in prose(path).splitlines() if line.lstrip().startswith("|")]
    assert [row for row in rows if len(row) > 240] == []


def test_every_result_that_is_shown_stands_on_the_page_of_its_verb():
    shown = re.findall(r"^## (.*)$", documented_commands.PICTURES.read_text("utf-8"), flags=re.M)
    assert sorted(shown) == sorted(reference_pages.VERBS)
    assert {path.stem for path in reference_pages.DOCS.glob("verbs/*.md")} <= set(reference_pages.VERBS)
    assert "![Critical depth and force over slenderness](stability/stability.png)" in reference_pages.page(
        "verb/stability"
    )


@pytest.fixture(scope="module")
def project():
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)["project"]


@pytest.mark.skipif(sys.platform != "linux", reason="packages of other platforms differ")
def test_no_pinned_package_is_there_that_nothing_asks_for(project):
    """CI installs all of them, so that one whose requirement is missing would be there for the tests only."""
    pinned = re.findall(r"^([\w.-]+)==", (ROOT / "constraints.txt").read_text("utf-8"), flags=re.M)
    # the site is built by who wants it, and CI does not
    extras = [one for name, more in project["optional-dependencies"].items() if name != "docs" for one in more]
    asked = needed(project["dependencies"] + extras)
    assert {re.sub(r"[-_.]+", "-", one).lower() for one in pinned} <= set(asked)


def test_one_version(project):
    version = project["version"]
    newest = re.search(r"^## \[?(\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text("utf-8"), flags=re.M)
    assert newest is not None
    assert newest[1] == version
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text("utf-8")


def test_what_a_machine_leaves_out_is_said_with_its_reason():
    """But for what `make plain` runs beside it."""
    reasons = ["not installed: clang", BY_PLAIN, "not installed: clang", "needs the extra `fast`"]
    reports = [
        pytest.TestReport(f"test_{k}", ("a.py", k, ""), {}, "skipped", ("a.py", k, f"Skipped: {reason}"), "setup")
        for k, reason in enumerate(reasons)
    ]
    said = ["left out: 2 tests, not installed: clang", "left out: 1 test, needs the extra `fast`"]
    assert left_out(reports) == said
