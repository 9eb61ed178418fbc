"""The manual: what its pages name exists (links, files, modules, commands), each says for whom it is, and the site of them builds."""

from __future__ import annotations

import ast
import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from key_tables import COMMAND, pages

from alula.common.generated import MARK
from alula_testing.waits import until
from manual_site import contents
from manual_site.sizes import lines, size_of, sizes

ALULA_ROOT = Path(__file__).resolve().parents[1]
ROOMS = sorted(path.name for path in ALULA_ROOT.iterdir() if path.is_dir() and path.name[0] != "." and path.name != "runs")
SOURCES = [
    ALULA_ROOT / "lib",
    ALULA_ROOT / "tests/support",
    ALULA_ROOT / "flight",
    ALULA_ROOT / "tools",
    *(path for path in (ALULA_ROOT / "ros2_ws/src").iterdir() if path.is_dir()),
    *(ALULA_ROOT / "ros1_ws/src").glob("*/src"),
    ALULA_ROOT / "bridge/ros_bridge",
]
"""Folders that Python's packages are imported from."""
PAGES = sorted(
    path
    for room in (".", *ROOMS)
    for path in (ALULA_ROOT.glob("*.md") if room == "." else (ALULA_ROOT / room).rglob("*.md"))
    if path.name != "CHANGELOG.md" and ".alula" not in path.parts  # what a set-up has made in an example's folder
)
NAMES = [str(path.relative_to(ALULA_ROOT)) for path in PAGES]
EXAMPLE = re.compile(r"[A-Z]{3,}|rover|patrol|porter|deliver\.|my_|[<>{}$@]|\.\.\.")
"""A placeholder, or what a page has its reader write."""


def spans(text: str) -> str:
    """Return what stands in code: between backticks, and in indented or fenced blocks."""
    fenced = re.findall(r"^```(?!skill|rl|diff|text|mermaid)\w*\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    indented = re.findall(r"^ {4,}\S.*$", text, re.MULTILINE)
    prose = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    return "\n".join([*fenced, *indented, *re.findall(r"`([^`]+)`", prose)])


def headings(text: str) -> set[str]:
    """Return the anchors of a page's headings, as forges make them."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}


def links(page: Path) -> Iterator[str]:
    """Yield what a page links to in the checkout."""
    return (target for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()) if not re.match(r"\w+:", target))


SIZES = {
    "README.md": 5_000,
    "docs/how-to": 6_000,
    "docs/start": 6_000,
    "docs/reference/performance.md": 22_500,
    "docs/reference/robots.md": 10_500,
    "docs/reference/mocks.md": 7_000,
    "docs/reference/bridge.md": 9_600,
    "docs/concepts": 8_400,
}
"""How many bytes a page may have: of a task, which is read whole, and of a reference that was made shorter."""


@pytest.mark.parametrize("name", NAMES)
def test_a_page_says_for_whom_it_is(name: str) -> None:
    """In the first sentence below its title, so that a reader knows whether to go on."""
    title, audience = (ALULA_ROOT / name).read_text(encoding="utf-8").split("\n\n", 2)[:2]
    assert re.fullmatch(r"# .+", title)
    assert audience.startswith("For ")


@pytest.mark.parametrize("name", [name for name in NAMES if name.startswith(tuple(SIZES))])
def test_a_page_is_no_longer_than_it_may_be(name: str) -> None:
    limit = next(size for place, size in SIZES.items() if name.startswith(place))
    assert (ALULA_ROOT / name).stat().st_size <= limit


MOST_COLUMNS = 120
UNFOLDED = ("|", "#", "!", "<", "    ")
"""Tables, headings, pictures, comments and code have one line each."""


def too_long(text: str) -> list[int]:
    """Return the numbers of the lines, written by hand and to be folded, that are longer than an editor beside another one shows."""
    fenced, found = False, []
    for number, line in enumerate(text.partition(MARK)[0].splitlines(), start=1):
        fenced ^= line.startswith("```")
        if len(line) > MOST_COLUMNS and not fenced and not line.startswith(UNFOLDED):
            found.append(number)
    return found


@pytest.mark.parametrize("name", [*NAMES, "CHANGELOG.md"])
def test_lines_of_a_page_are_folded(name: str) -> None:
    assert too_long((ALULA_ROOT / name).read_text(encoding="utf-8")) == []


def test_a_line_that_is_not_folded_is_found() -> None:
    long = "word " * 30
    assert too_long(f"a\n{long}\n| {long}\n```\n{long}\n```\n- {long}\n{MARK} x -->\n{long}") == [2, 7]


def torn(text: str) -> list[int]:
    """Return the numbers of the lines at which a table begins without its head: rows that a forge shows as text."""
    lines = re.sub(r"^```.*?^```", lambda code: "\n" * code[0].count("\n"), text, flags=re.MULTILINE | re.DOTALL).splitlines()
    begins = (number for number, line in enumerate(lines, start=1) if line.startswith("|") and not lines[number - 2].startswith("|"))
    return [number for number in begins if number == len(lines) or not re.fullmatch(r"[|:\- ]+", lines[number])]


@pytest.mark.parametrize("name", NAMES)
def test_no_table_of_a_page_is_torn(name: str) -> None:
    assert torn((ALULA_ROOT / name).read_text(encoding="utf-8")) == []


def test_a_torn_table_is_found() -> None:
    assert torn("a\n\n| a |\n|---|\n| 1 |\n\n| 2 |\n\n```\n| b |\n```\n") == [7]


def test_the_pages_are_counted_apart_from_what_programs_write() -> None:
    page = size_of("a.md", "# A\n\nFor ü.\n\n<!-- Below this line: written by `x`. -->\n\nmore\n")
    assert (page.by_hand, page.generated) == (14, 48)
    by_name = {size.name: size for size in sizes()}
    assert by_name["README.md"].generated == 0
    assert by_name["docs/reference/commands.md"].generated > 10 * by_name["docs/reference/commands.md"].by_hand
    *_, manual, experiments = lines(list(by_name.values()))
    assert manual.endswith("the manual")
    assert experiments.split()[1:] == ["0", "experiments"]


def test_the_list_of_pages_is_current() -> None:
    text = contents.PAGE.read_text(encoding="utf-8")
    assert text == contents.page(text), f"write it again: {contents.COMMAND}"


def test_the_tables_of_keys_are_current() -> None:
    assert [path.name for path, text in pages() if path.read_text(encoding="utf-8") != text] == [], f"write them again: {COMMAND}"


def test_a_page_is_listed_with_the_first_sentence_below_its_title() -> None:
    assert contents.audience("# A\n\nFor [users](b.md) of `x.y`: what 0.3 is. More.\n\n## B") == "users of `x.y`: what 0.3 is"
    assert contents.audience("# A\n\nOf something else.\n") == ""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site as CONTRIBUTING says; a page that the navigation lacks, a dead link or anchor is an error."""
    folder = tmp_path_factory.mktemp("site")
    command = [ALULA_ROOT / "setup/in_ros2", "mkdocs", "build", "--strict", "--site-dir", folder]
    done = subprocess.run(command, cwd=ALULA_ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_site_has_every_page(site: Path) -> None:
    """But for the README, which is the front of the checkout, as index.md is of the site; a README of a folder is its index."""
    made = {str(path.relative_to(site).with_suffix("")) for path in site.rglob("*.html")}
    wanted = {name.removeprefix("docs/").removesuffix(".md") for name in NAMES if name != "README.md"}
    assert not {re.sub(r"README$", "index", name) for name in wanted} - made


def test_the_site_works_without_a_network(site: Path) -> None:
    """No page fetches from another host, and the search's index is a script, which a browser reads from a disk."""
    fetched = re.compile(r"""<(?:script|img|iframe|source)[^>]*\ssrc=["']?(?:https?:)?//|<link[^>]*rel=["']?stylesheet[^>]*//""")
    assert not [str(path.relative_to(site)) for path in site.rglob("*.html") if fetched.search(path.read_text(encoding="utf-8"))]
    index = (site / "search/search_index.js").read_text(encoding="utf-8")
    for words in ("Which world the managers run in", "over-approximation", "ALU521"):
        assert words in index


def test_the_site_is_searched_from_a_disk(site: Path, browser: Any) -> None:
    """As a browser opens it without any server: the search answers, and nothing goes wrong."""
    browser.get(f"{(site / 'concepts/terminology.html').as_uri()}?q=counterexample")
    until(lambda: browser.find_elements("css selector", ".md-search-result__item"), "a result of the search")
    assert not [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


def test_links_of_the_site_lead_to_its_pages(site: Path) -> None:
    """Also those from and to pages outside of docs/, which the hook has rewritten."""
    dead = []
    for path in site.rglob("*.html"):
        for target in re.findall(r"""<(?:a|img)[^>]*\s(?:href|src)=["']?([^"'\s>]+)""", path.read_text(encoding="utf-8")):
            place = target.partition("#")[0]
            if place and not re.match(r"\w+:", place) and path.name != "404.html" and not (path.parent / place).exists():
                dead.append(f"{path.relative_to(site)}: {target}")
    assert not dead


def test_the_terminology_explains_each_word_once() -> None:
    page = (ALULA_ROOT / "docs/concepts/terminology.md").read_text(encoding="utf-8")
    terms = [term.strip() for row in re.findall(r"^\| ([^|]+) \|", page, re.MULTILINE) for term in row.split(",")]
    terms = [term for term in terms if term != "term"]
    assert len(terms) >= 60
    assert sorted(terms) == sorted(set(terms))


def test_each_page_is_found_from_the_readme() -> None:
    """From the README by links, in any number of steps."""
    found: set[Path] = set()
    waiting = [ALULA_ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page not in found and page.suffix == ".md" and page.exists():
            found.add(page)
            waiting += [(page.parent / target.partition("#")[0]).resolve() for target in links(page) if target[0] != "#"]
    assert not [str(path.relative_to(ALULA_ROOT)) for path in PAGES if path not in found]


@pytest.mark.parametrize("name", NAMES)
def test_links_lead_somewhere(name: str) -> None:
    page = ALULA_ROOT / name
    dead = []
    for target in links(page):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and anchor not in headings(file.read_text())):
            dead.append(target)
    assert not dead


GENERATED = {"model.py", "inputs.py", "hooks.py", "client.py", "mock.py"}
"""What a build makes of a model."""


@cache
def files() -> frozenset[str]:
    """Return the names of all files of the rooms, and of what a build makes."""
    return frozenset(GENERATED).union(path.name for room in ROOMS for path in (ALULA_ROOT / room).rglob("*") if path.is_file())


def robot_of(page: Path) -> Path:
    """Return the folder that a page names paths in: that of the robot that it belongs to."""
    return next(folder for folder in page.parents if folder == ALULA_ROOT or (folder / "robot.yaml").is_file())


def missing_paths(page: Path) -> Iterator[str]:
    """Yield the paths below a room, and the source files, that a page names and that are not there."""
    code = spans(page.read_text())
    roots = {ALULA_ROOT, robot_of(page)}
    for path in re.findall(r"(?<![\w/.~$-])(?:\./)?((?:[\w@.+-]+/)+[\w@.*+-]*)", code):
        if path.split("/")[0] in ROOMS and not EXAMPLE.search(path) and not any(list(root.glob(path.rstrip("./"))) for root in roots):
            yield path
    for path in re.findall(r"(?<![\w/.*<@-])((?:\w+/)*\w+\.(?:py|js|cpp|hpp|launch|srv|msg))\b(?!\.)", code):
        if not EXAMPLE.search(path) and path.split("/")[-1] not in files():
            yield path


@pytest.mark.parametrize("name", NAMES)
def test_named_files_exist(name: str) -> None:
    assert not list(missing_paths(ALULA_ROOT / name))


@cache
def packages() -> dict[str, Path]:
    """Return the folders of the checkout's Python packages by their names."""
    found = {path.parent.name: path.parent for source in SOURCES for path in source.glob("*/__init__.py")}
    return found | {path.name: path for path in (ALULA_ROOT / "lib").iterdir() if path.name == "alula"}


@cache
def defined(module: Path) -> frozenset[str]:
    """Return all names that a module binds, also inside of its classes."""
    tree = ast.parse(module.read_text())
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
    bound = {node.name for node in ast.walk(tree) if isinstance(node, kinds)}
    bound |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    return frozenset(
        bound | {alias.asname or alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names}
    )


def exists(dotted: str) -> bool:
    """Return whether a module is there, and what is named in it."""
    first, *rest = dotted.split(".")
    place = packages()[first]
    while rest and (place / rest[0]).is_dir():
        place /= rest.pop(0)
    module = place / "__init__.py"
    if rest and (place / f"{rest[0]}.py").is_file():
        module = place / f"{rest.pop(0)}.py"
    return not rest or (module.is_file() and rest[0] in defined(module))


@pytest.mark.parametrize("name", NAMES)
def test_named_modules_exist(name: str) -> None:
    known = "|".join(sorted(packages()))
    named = re.findall(
        rf"(?<![\w/.-])((?:{known})(?:\.[A-Za-z_]\w*)+)(?![\w/]|\.(?:yaml|launch|md|py))", spans((ALULA_ROOT / name).read_text())
    )
    assert not sorted({dotted for dotted in named if not EXAMPLE.search(dotted) and not exists(dotted)})


@cache
def commands() -> frozenset[str]:
    """Return the commands and benches that the entry script tells of."""
    told = subprocess.run([ALULA_ROOT / "alula", "help"], capture_output=True, text=True, check=True).stdout
    return frozenset(re.findall(r"^  (\w+)", told, re.MULTILINE)) | {"help"}


@pytest.mark.parametrize("name", NAMES)
def test_named_commands_exist(name: str) -> None:
    named = re.findall(r"(?:^|[\s/])alula ([a-z]\w*)", spans((ALULA_ROOT / name).read_text()))
    assert not set(named) - commands()
