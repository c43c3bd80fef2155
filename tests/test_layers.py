"""The house keeps its order: who imports whom, unique names, and slow imports where they are used."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
ALLOWED = {
    "geometry": {"geometry"},
    "fem": {"fem", "geometry"},
    "analytic": {"analytic", "geometry"},
    "studies": {"studies", "fem", "analytic", "geometry"},
}
HEAVY = {
    "build123d",
    "OCP",
    "pyvista",
    "vtkmodules",
    "pandas",
    "matplotlib",
    "pydantic",
    "trimesh",
    "lib3mf",
    "meshio",
}
FILES = sorted(path for package in ALLOWED for path in (ROOT / package).rglob("*.py"))


def name(path):
    return path.relative_to(ROOT).as_posix()


def top(node):
    """The top-level packages that an import statement names."""
    if isinstance(node, ast.Import):
        return {alias.name.split(".")[0] for alias in node.names}
    assert node.level == 0, "imports are absolute here"
    return {node.module.split(".")[0]}


def imports(tree):
    return [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]


def at_import_time(body):
    """Import statements that run when the module is imported: not in functions, not for type checkers only."""
    for node in body:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            yield node
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from at_import_time(node.orelse)
        elif not isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            blocks = [getattr(node, part, []) for part in ("body", "orelse", "handlers", "finalbody")]
            for block in blocks:
                yield from at_import_time(block)


@pytest.mark.parametrize("path", FILES, ids=name)
def test_imports_run_one_way(path):
    ours = {package for node in imports(ast.parse(path.read_text("utf-8"))) for package in top(node)} & set(ALLOWED)
    assert ours <= ALLOWED[path.relative_to(ROOT).parts[0]]


@pytest.mark.parametrize("path", FILES, ids=name)
def test_slow_imports_stay_inside_functions(path):
    found = {package for node in at_import_time(ast.parse(path.read_text("utf-8")).body) for package in top(node)}
    assert not found & HEAVY


def test_the_checks_can_fail():
    source = (
        "import pandas\ntry:\n    import fem.modes\nexcept ImportError:\n    pass\ndef f():\n    import pyvista\n"
    )
    tree = ast.parse(source)
    assert {package for node in imports(tree) for package in top(node)} == {"pandas", "fem", "pyvista"}
    assert {package for node in at_import_time(tree.body) for package in top(node)} == {"pandas", "fem"}


def test_module_names_are_unique():
    names = [path.stem for path in FILES if path.stem not in ("__init__", "__main__")]
    assert len(names) == len(set(names))
    assert not set(names) & set(ALLOWED)


def test_command_imports_nothing_slow():
    code = "import sys, studies.cli.commands; print(*sorted({m.split('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not set(loaded.stdout.split()) & (HEAVY | {"numpy", "scipy", "skfem"})


def test_each_folder_of_modules_is_a_package():
    """Else doctests in it are not collected, and a wheel may leave it out."""
    assert not [name(path) for path in FILES if not (path.parent / "__init__.py").exists()]


@pytest.mark.parametrize("path", FILES, ids=name)
def test_no_machine_paths(path):
    assert not re.search(r"/(home|work|Users|root)/", path.read_text("utf-8"))
