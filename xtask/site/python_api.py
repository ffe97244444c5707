"""Writes the pages of the Python package's interface: each public name of a module with its
signature and its docstring, as Markdown.

``python xtask/site/python_api.py FOLDER``, with the package on the path.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pathlib
import re
import sys

MODULES = ("snell", "snell.distributed", "snell.usd", "snell.trimesh", "snell.open3d")
STUB = pathlib.Path(__file__).parents[2] / "python/snell/_snell.pyi"


def stub_signatures() -> dict[str, list[str]]:
    """The signatures in the stub, by names such as ``Scene.cast_rays``; several where the function
    is overloaded.
    """
    found: dict[str, list[str]] = {}

    def visit(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.ClassDef):
                visit(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.FunctionDef):
                name = prefix + node.name
                node.decorator_list = [
                    d for d in node.decorator_list if "property" in ast.unparse(d)
                ]
                is_property = bool(node.decorator_list)
                arguments = ast.unparse(node.args)
                arguments = re.sub(r"^(self|cls)(, /)?(, )?", "", arguments)
                returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
                text = returns.replace(" -> ", ": ") if is_property else f"({arguments}){returns}"
                found.setdefault(name, []).append(text)

    visit(ast.parse(STUB.read_text(encoding="utf-8")).body, "")
    return found


STUBS = stub_signatures()


class Shown:
    """What a signature shows in place of an annotation or a default."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


def shown(value: object) -> object:
    """An annotation or a default as a program would write it."""
    if value is inspect.Signature.empty:
        return value
    if isinstance(value, type):
        is_near = value.__module__ in ("builtins", "snell", "snell._snell")
        return Shown(value.__name__ if is_near else f"{value.__module__}.{value.__name__}")
    return value


def signature(thing: object) -> str:
    """The signature of a function or a class, without the object that a method is of."""
    found = inspect.signature(thing)  # type: ignore[arg-type]

    def annotation(value: object) -> object:
        return Shown(value) if isinstance(value, str) else shown(value)

    parameters = [
        p.replace(annotation=annotation(p.annotation), default=shown(p.default))
        for p in found.parameters.values()
        if p.name not in ("self", "cls")
    ]
    returns = annotation(found.return_annotation)
    text = str(found.replace(parameters=parameters, return_annotation=returns))
    return text.removesuffix(" -> None") if inspect.isclass(thing) else text


def signatures(thing: object, name: str, module: str) -> list[str]:
    """What to write behind the name of a thing; empty if nothing is known."""
    if name in STUBS and module == "snell":
        return STUBS[name]
    if isinstance(thing, property):
        return [""]
    try:
        return [signature(thing)]
    except (TypeError, ValueError):
        return [""]


def laid_out(text: str) -> str:
    """A signature with a line for each parameter, if it is too long for one line."""
    start = text.find("(")
    if len(text) <= 88 or start < 0:
        return text
    depth, parts = 0, [""]
    for index, c in enumerate(text[start:], start):
        depth += (c in "([{") - (c in ")]}")
        if depth == 0:
            break
        if c == "," and depth == 1:
            parts.append("")
        elif index > start:
            parts[-1] += c
    inner = "".join(f"    {part.strip()},\n" for part in parts)
    return f"{text[: start + 1]}\n{inner}{text[index:]}"


def is_sentence(lines: list[str], index: int) -> bool:
    """True for a line in a list of parameters that is no parameter but text after the list."""
    line = lines[index]
    has_text = index + 1 < len(lines) and lines[index + 1].startswith(" ")
    return not (line.startswith(" ") or has_text or " : " in line) and len(line.split()) > 4


def markdown(docstring: str) -> str:
    """A docstring in NumPy's form as Markdown."""
    text = re.sub(r"\s+# doctest: \+\w+", "", inspect.cleandoc(docstring))
    text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", text).replace("``", "`")
    out, section, is_code, is_prose = [], "", False, False
    lines = text.splitlines()
    index = 0
    while index < len(lines):
        line = lines[index]
        ruled = index + 1 < len(lines) and re.fullmatch(r"-{3,}", lines[index + 1].strip())
        if ruled and line.strip():
            if is_code:
                out.append("```")
                is_code = False
            section = line.strip()
            out += ["", f"**{section}**", ""]
            index += 2
            continue
        if line.startswith(">>> ") and not is_code:
            out += ["", "```pycon"]
            is_code = True
        if is_code and not line.strip():
            following = next((x for x in lines[index + 1 :] if x.strip()), "")
            if not following.startswith(">>>"):
                out.append("```")
                is_code = False
        entries = section in ("Parameters", "Returns", "Raises", "Attributes", "Yields", "Warns")
        if is_code or not entries:
            out.append(line)
        elif is_prose or is_sentence(lines, index):
            is_prose = bool(line.strip())
            out.append(line)
        elif not line.startswith(" ") and line.strip():
            name, colon, kind = line.partition(" : ")
            kind = f" ({kind.replace('`', '')})" if colon else ""
            has_text = index + 1 < len(lines) and lines[index + 1].startswith(" ")
            out += ["", f"* `{name}`{kind}{':' if has_text else ''}"]
        else:
            out.append("    " + line.strip() if line.strip() else "")
        index += 1
    if is_code:
        out.append("```")
    return re.sub(r"\n{3,}", "\n\n", "\n".join(out)).strip() + "\n"


def entry(level: int, name: str, thing: object, module: str) -> str:
    """The heading, signature and text of one name."""
    lines = [laid_out(name + text) for text in signatures(thing, name, module) if text]
    code = "```python\n" + "\n".join(lines) + "\n```\n" if lines else ""
    text = markdown(getattr(thing, "__doc__", None) or "")
    return f"{'#' * level} `{name}`\n\n{code}\n{text}\n"


def constant(name: str, value: object) -> str:
    """A name whose value is no function and no class."""
    content = (
        f"one entry for each of {', '.join(f'`{k}`' for k in value)}"
        if isinstance(value, dict)
        else f"`{value!r}`"
    )
    return f"## `{name}`\n\nA constant: {content}.\n\n"


def page(module_name: str) -> str:
    """The page of a module."""
    module = importlib.import_module(module_name)
    text = f"# `{module_name}`\n\n{markdown(module.__doc__ or '')}\n"
    names = [name for name in module.__all__ if not name.startswith("_")]
    for name in sorted(names, key=str.lower):
        thing = getattr(module, name)
        if not (inspect.isclass(thing) or inspect.isroutine(thing)):
            text += constant(name, thing)
            continue
        text += entry(2, name, thing, module_name)
        if inspect.isclass(thing):
            members = {
                key: value
                for key, value in vars(thing).items()
                if not key.startswith("_") and getattr(value, "__doc__", None)
            }
            for key in sorted(members):
                text += entry(3, f"{name}.{key}", members[key], module_name)
    return text


def main() -> None:
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name in MODULES:
        (folder / f"{name}.md").write_text(page(name), encoding="utf-8")


if __name__ == "__main__":
    main()
