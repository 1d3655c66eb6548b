"""What the files of the house define and import, as their sources say."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("assets", "scenarios", "sim", "synthesis")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
# By dotted name, without the `fulcrum.` that all have.
SOURCES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in FILES
}


def name(path):
    return path.relative_to(ROOT).as_posix()


def sources():
    """The text of every module."""
    return {module: path.read_text() for module, path in SOURCES.items()}


def public_types(source):
    """Classes and aliases of types that a module defines for others."""
    found = set()
    for node in ast.parse(source).body:
        if isinstance(node, ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names = {target.id for target in targets if isinstance(target, ast.Name)}
            found |= {each for each in names if each[0].isupper() and not each.isupper()}
    return {each for each in found if not each.startswith("_")}


def shared_types(texts):
    """Types that several modules define, each with the modules, of texts by module."""
    owners = {}
    for module, source in texts.items():
        for each in public_types(source):
            owners.setdefault(each, []).append(module)
    return {each: modules for each, modules in owners.items() if len(modules) > 1}


def own_imports(source):
    """Modules of the house and names in them that a source imports, wherever the import stands."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {(alias.name, "") for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {(node.module, alias.name) for alias in node.names}
    prefix = "fulcrum."
    own = {(m.removeprefix(prefix), n) for m, n in found if m.startswith(prefix)}
    return own | {(n, "") for m, n in found if m == "fulcrum" and n}


def module_graph(texts):
    """For each module those that importing it loads; packages of its own are not counted.

    To import a module is to import its packages, too, which is not seen in the source.
    """
    graph = {}
    for module, source in texts.items():
        graph[module] = set()
        for target, each in own_imports(source):
            parts = (f"{target}.{each}" if f"{target}.{each}" in texts else target).split(".")
            loaded = {".".join(parts[: n + 1]) for n in range(len(parts))}
            own = {package for package in loaded if f"{module}.".startswith(f"{package}.")}
            graph[module] |= (loaded - own) & set(texts)
    return graph


def package_graph(modules):
    """Of a graph of modules that of their packages; modules beside packages count as one."""
    graph = {}
    for module, targets in modules.items():
        own = package(module, modules)
        graph.setdefault(own, set()).update(package(target, modules) for target in targets)
        graph[own].discard(own)
    return graph


def package(module, modules):
    """The package that a module is in; a package is in itself."""
    inside = any(other.startswith(f"{module}.") for other in modules)
    return module if inside else module.rpartition(".")[0]


def circles(graph):
    """Groups of nodes that all reach one another."""

    def reached(start):
        seen, waiting = set(), [start]
        while waiting:
            for node in graph.get(waiting.pop(), set()) - seen:
                seen.add(node)
                waiting.append(node)
        return seen

    reach = {node: reached(node) for node in graph}
    groups = {
        frozenset(other for other in reach[node] if node in reach.get(other, ()))
        for node in graph
        if node in reach[node]
    }
    return sorted(sorted(group) for group in groups)
