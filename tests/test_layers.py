"""Structure of the packages: allowed imports, unique module names, and slow imports in functions only."""

import ast
import importlib
import inspect
import re
from functools import cache
from pathlib import Path

import pandas as pd
import pytest

import fem
import magtip
from fem.accuracy import QUICK
from fem.equilibrium import solve
from geometry.design import BadInput, Design, paper
from geometry.loads import Load
from studies.cases import answer

ROOT = Path(__file__).resolve().parent.parent
ALLOWED = {
    "geometry": {"geometry"},
    "fem": {"fem", "geometry"},
    "analytic": {"analytic", "geometry"},
    "studies": {"studies", "fem", "analytic", "geometry"},
    "magtip": {"magtip", "studies", "fem", "analytic", "geometry"},
}
SLOW = "build123d OCP pyvista vtkmodules pandas matplotlib altair vl_convert pydantic trimesh pytetwild lib3mf meshio"
HEAVY = {*SLOW.split(), "SALib", "jinja2", "markdown_it", "sklearn"}
FILES = sorted(path for package in ALLOWED for path in (ROOT / package).rglob("*.py"))


def name(path):
    return path.relative_to(ROOT).as_posix()


@cache
def tree_of(path):
    """The syntax tree of a file, parsed once for all checks."""
    return ast.parse(path.read_text("utf-8"))


def top(node):
    """The top-level packages that an import statement names."""
    if isinstance(node, ast.Import):
        return {alias.name.split(".")[0] for alias in node.names}
    assert node.level == 0, "imports are absolute here"
    return {node.module.split(".")[0]}


STUDIES = "output inputs parts beam mechanics models answers sensing sweeps cases simulation fabrication sensitivity"
STUDIES = [
    "deferred_modules",
    "quantities",
    *STUDIES.split(),
    "calibration",
    "firmware",
    "sizing",
    "demo",
    "web",
    "streaming",
    "validation",
    "cli",
    "examples",
]
"""Sub-packages of `studies`, and its modules, from below: each imports only those below it."""


def module_name(path):
    """The dotted name of a module, or of a package.

    >>> module_name(ROOT / "fem" / "__init__.py")
    'fem'
    """
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_modules(tree, modules):
    """Those of some modules that a module imports, inside functions too; what a package defines is the package's."""
    imported = set()
    for node in imports(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        else:
            whole = {f"{node.module}.{alias.name}" for alias in node.names}
            imported |= (whole & modules) | ({node.module} if whole - modules else set())
    return imported & modules


def circles(graph):
    """Groups of modules that import each other, directly or through others; the graph names what each imports."""
    reached = {name: {name} for name in graph}
    changed = True
    while changed:
        changed = False
        for name, nexts in graph.items():
            more = set().union(*(reached[other] for other in nexts)) - reached[name] if nexts else set()
            reached[name] |= more
            changed = changed or bool(more)
    groups = {frozenset(other for other in reached[name] if name in reached[other]) for name in graph}
    return sorted(sorted(group) for group in groups if len(group) > 1)


@cache
def import_graph():
    """What each module of the packages imports of them."""
    names = {module_name(path): path for path in FILES}
    return {name: imported_modules(tree_of(path), set(names)) for name, path in names.items()}


@cache
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


def test_imports_run_one_way():
    wrong = {}
    for path in FILES:
        ours = {package for node in imports(tree_of(path)) for package in top(node)} & set(ALLOWED)
        # the examples are programs of users, above all packages
        package = "magtip" if path.parent.name == "examples" else path.relative_to(ROOT).parts[0]
        wrong[name(path)] = ours - ALLOWED[package]
    assert {path: packages for path, packages in wrong.items() if packages} == {}


def test_the_discretised_problem_knows_no_solver():
    """`fem.model` is the problem, `fem.solve` solves it: the problem imports neither solver nor analysis."""
    below = ("fem.model", "fem.scene", "fem.accuracy", "geometry")
    upwards = [
        (module, other)
        for module, others in import_graph().items()
        for other in others
        if module.startswith("fem.model") and not other.startswith(below)
    ]
    assert upwards == []


def test_no_imports_run_in_a_circle():
    assert circles(import_graph()) == []


def test_a_circle_of_imports_is_seen():
    modules = {"a.x", "a.y", "a.z", "a"}
    source = "from a.y import thing\ndef f():\n    from a import z\n    import numpy\n"
    assert imported_modules(ast.parse(source), modules) == {"a.y", "a.z"}
    assert imported_modules(ast.parse("from a import thing"), modules) == {"a"}
    graph = {"a.x": {"a.y", "a.z"}, "a.y": {"a.z"}, "a.z": {"a.x"}, "a": set(), "b": {"a.x"}}
    assert circles(graph) == [["a.x", "a.y", "a.z"]]
    assert circles(graph | {"a.z": set()}) == []


def test_sub_packages_of_studies_import_only_those_below():
    level = {part: k for k, part in enumerate(STUDIES)}
    upwards = [
        (name, other)
        for name, others in import_graph().items()
        for other in others
        if name.startswith("studies.") and other.startswith("studies.")
        for ours, theirs in [(name.split(".")[1], other.split(".")[1])]
        if ours != theirs and level[theirs] >= level[ours]
    ]
    assert upwards == []


def test_slow_imports_stay_inside_functions():
    outside = [
        (name(path), package)
        for path in FILES
        for node in at_import_time(tree_of(path).body)
        for package in top(node) & HEAVY
        # a study of validation, which its verb imports, takes longer than tables take to import
        if not (package == "pandas" and "validation" in path.parts)
        and not (package == "pydantic" and module_name(path) in FILE_MODELS)
    ]
    assert outside == []


FILE_MODELS = {"studies.inputs.file_models", "studies.parts.catalogue_file"}
"""Modules of pydantic models, which others import where a file is read."""


def test_models_of_files_are_imported_where_a_file_is_read():
    at_once = [
        (name(path), module)
        for path in FILES
        if module_name(path) not in FILE_MODELS
        for node in at_import_time(tree_of(path).body)
        for module in imported_modules(ast.Module([node], []), FILE_MODELS)
    ]
    assert at_once == []


def test_the_checks_can_fail():
    source = (
        "import pandas\ntry:\n    import fem.scene\nexcept ImportError:\n    pass\ndef f():\n    import pyvista\n"
    )
    tree = ast.parse(source)
    assert {package for node in imports(tree) for package in top(node)} == {"pandas", "fem", "pyvista"}
    assert {package for node in at_import_time(tree.body) for package in top(node)} == {"pandas", "fem"}


def test_module_names_are_unique():
    names = [path.stem for path in FILES if path.stem not in ("__init__", "__main__")]
    assert len(names) == len(set(names))
    assert not set(names) & set(ALLOWED)


def test_each_folder_of_modules_is_a_package():
    """Else doctests in it are not collected, and a wheel may leave it out; its annotations hold for users, too."""
    assert not [name(path) for path in FILES if not (path.parent / "__init__.py").exists()]
    assert not [package for package in ALLOWED if not (ROOT / package / "py.typed").exists()]


def test_no_machine_paths():
    machine = re.compile(r"/(home|work|Users|root)/")
    assert [name(path) for path in FILES if machine.search(path.read_text("utf-8"))] == []


# Public modules from Python: what they export, what help shows, and what wrong arguments are told.


ANALYSES = ("force_targets", "stability", "small_shear", "modes", "vibration", "timed_path")
MODULES = ["magtip", "geometry.design", "geometry.loads", "fem.accuracy", "fem.equilibrium"]
MODULES += [f"fem.analyses.{name}" for name in ANALYSES]
MODULES += [f"analytic.{name}" for name in ("beam", "magnet", "hall", "parts", "stream")]


@pytest.mark.parametrize("name", MODULES)
def test_exported_names_exist_and_have_help(name):
    module = importlib.import_module(name)
    for exported in module.__all__:
        value = getattr(module, exported)
        if inspect.isfunction(value) or inspect.isclass(value):
            assert inspect.getdoc(value), exported
    # a star import brings no library along
    assert not any(inspect.ismodule(getattr(module, exported)) for exported in module.__all__)


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda: solve(paper(), Load(1.0), "quik"), TypeError, "accuracy must be one of quick, standard, fine, or"),
        (
            lambda: solve(paper()),
            TypeError,
            "solve takes a load or the fields of one: write solve(design, Load(depth",
        ),
        (lambda: solve(paper(), Load(1.0), shear_x=1.0), TypeError, "solve takes a load or the fields of one: write"),
        (lambda: solve(paper(), depht=1.0), TypeError, "Load has no depht: did you mean depth?"),
        (lambda: Load(shear=1), TypeError, "Load has no shear: did you mean shear_x?"),
        (lambda: Design(magnet_diam=3), TypeError, "Design has no magnet_diam: did you mean magnet_diameter?"),
        (
            lambda: fem.solve(paper()),
            TypeError,
            "fem.solve is a sub-package: write `from fem.equilibrium import solve",
        ),
        (
            lambda: answer(pd.DataFrame(), "fem"),
            BadInput,
            "models must be a list of names, such as ['fem']; got 'fem'",
        ),
        (
            lambda: answer(pd.DataFrame({"depth_mm": [1.0]}), workers="2"),
            BadInput,
            "`workers` must be a whole number from 0 to 1024; got '2'",
        ),
        (lambda: solve(paper(), Load(1.0), QUICK, magnet="none"), BadInput, "magnet must be rigid or ignored; got"),
        (lambda: solve(paper(), 1.0), TypeError, "the load must be a Load, such as Load(depth=1.0); got 1.0"),
        (lambda: solve("paper", Load(1.0)), TypeError, "the design must be a Design, such as paper(); got 'paper'"),
        (lambda: Load("1"), BadInput, "depth must be a number; got '1'"),
        (lambda: Load(depth=True), BadInput, "depth must be a number; got True"),
        (lambda: Load(1.0, 0.2, friction=None), BadInput, "friction must be none, stick or a coefficient"),
        (lambda: Load(shear_x=0.2, grip="1"), BadInput, "grip must be a positive height in mm; got '1'"),
    ],
)
def test_wrong_arguments_are_told_what_is_accepted(call, error, text):
    with pytest.raises(error) as raised:
        call()
    assert str(raised.value).startswith(text)
    assert "\n" not in str(raised.value)


def test_what_a_user_writes_first_is_taken():
    assert paper(L=20.0) == Design(L=20.0)
    short, whole = solve(paper(), depth=0.1, accuracy="quick"), solve(paper(), Load(depth=0.1), QUICK)
    assert short.response == whole.response


def test_the_public_interface_names_what_a_type_checker_sees():
    seen = {}
    for node in next(node for node in tree_of(ROOT / "magtip/__init__.py").body if isinstance(node, ast.If)).body:
        seen |= {alias.name: node.module for alias in node.names}
    assert seen == magtip.LATER
    assert set(seen) < set(magtip.__all__) <= set(dir(magtip))
    with pytest.raises(AttributeError, match="module 'magtip' has no attribute 'anwser'"):
        magtip.anwser  # noqa: B018


# beneath `magtip.answer`, `plot`, `problem` and `size`; other modules of studies serve the command line only
FROM_PYTHON = [path for path in FILES if path.relative_to(ROOT).parts[0] in ("fem", "geometry", "analytic", "magtip")]
FROM_PYTHON += [path for path in FILES if path.parent.name == "sizing"]
FROM_PYTHON += [
    ROOT / "studies" / f"{name}.py"
    for name in (
        *("cases", "sweeps/answer_plot", "answers", "sweeps/study_rows"),
        *(
            "parts/catalogues",
            "parts/requirements",
            "mechanics/solve_plan",
            "mechanics/store",
            "mechanics/study_cases",
        ),
        *("mechanics/model_choice", "mechanics/timed_quantities", "mechanics/executor", "mechanics/tasks"),
    )
]


@pytest.mark.parametrize("path", FROM_PYTHON, ids=name)
def test_messages_to_python_name_no_option_of_the_command_line(path):
    """A message says `workers`, which the command line shows as --workers."""
    for node in ast.walk(tree_of(path)):
        # constants that hold a part of several messages, too
        for message in ast.walk(node) if isinstance(node, ast.Raise) or is_constant(node) else ():
            if isinstance(message, ast.Constant) and isinstance(message.value, str):
                assert not re.search(r"--[a-z]", message.value)


def is_constant(node):
    return isinstance(node, ast.Assign) and all(
        isinstance(one, ast.Name) and one.id.isupper() for one in node.targets
    )


# Deferred modules: there for whoever uses them.


def touched(tree):
    """What a module uses that is not its to use: private names of others, the collector, the environment."""
    here = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute) and of_itself(node)}
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and (node.arg or "").startswith("_"):
            yield node.arg
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.endswith("__"):
            # a named tuple's _replace is public
            yield from () if of_itself(node) or node.attr in {*here, "_replace"} else [node.attr]
        elif isinstance(node, (ast.Import, ast.ImportFrom)) and "gc" in top(node):
            yield "gc"
        elif isinstance(node, ast.Attribute) and ast.unparse(node) in ("os.environ", "os.putenv", "os.unsetenv"):
            yield node.attr


def of_itself(node):
    return isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")


def test_physics_touches_neither_private_names_nor_collector_nor_environment():
    physics = [path for path in FILES if path.relative_to(ROOT).parts[0] in ("geometry", "fem", "analytic")]
    found = {name(path): sorted(set(touched(tree_of(path)))) for path in physics}
    # the number of threads that the user allows is read
    assert {path: names for path, names in found.items() if names} == {"geometry/compiled.py": ["environ"]}
