"""The texts of the workbench: all of them can be translated, and the template has them.

    python tests/freecad/test_translations.py

writes the template again.
"""

import ast
from pathlib import Path
from xml.etree import ElementTree

FOLDER = Path(__file__).parents[2] / "src/kerfpath/freecad/kerfpath_wb/freecad/kerfpath_wb"
TEMPLATE = FOLDER / "translations" / "kerfpath.ts"
SHOWN = {
    "NotFound", "PickError", "ProcessError", "QLabel", "QPushButton", "_say", "addButton", "addTab",
    "openTransaction", "setText", "setToolTip", "setWindowTitle", "tell",
}  # fmt: skip
"""Calls whose first or second argument a user reads."""


def modules():
    for path in sorted(FOLDER.glob("*.py")):
        yield path.name, ast.parse(path.read_text(encoding="utf-8"))


def calls(module):
    name, tree = module
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            called = getattr(node.func, "attr", None) or getattr(node.func, "id", "")
            yield f"{name}:{node.lineno}", called, node.args


def words(module):
    """Yield the texts of a module that are translated."""
    for _, called, args in calls(module):
        if called == "tr" and isinstance(args[0], ast.Constant):
            yield args[0].value
    for node in ast.walk(module[1]):
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") in ("MENU", "TIP"):
            yield node.value.value  # FreeCAD asks for it, and then it is translated


def template():
    """Return the template as Qt Linguist reads it."""
    root = ElementTree.Element("TS", version="2.1", sourcelanguage="en")
    context = ElementTree.SubElement(root, "context")
    ElementTree.SubElement(context, "name").text = "kerfpath"
    texts = [text for module in modules() for text in words(module)]
    for text in dict.fromkeys(texts):
        message = ElementTree.SubElement(context, "message")
        ElementTree.SubElement(message, "source").text = text
        ElementTree.SubElement(message, "translation", type="unfinished")
    ElementTree.indent(root)
    body = ElementTree.tostring(root, encoding="unicode")
    return f'<?xml version="1.0" encoding="utf-8"?>\n<!DOCTYPE TS>\n{body}\n'


def literal(node):
    """Return the words of a text that is written where it is shown, or ""."""
    if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "format":
        return literal(node.func.value)
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return "".join(filter(str.isalpha, node.value.replace("{:.1f}", "")))
    return ""


def test_what_a_user_reads_can_be_translated():
    fixed = [
        (at, literal(a))
        for module in modules()
        for at, name, args in calls(module)
        if name in SHOWN
        for a in args[:2]
    ]
    # Units are the same in all languages.
    assert [each for each in fixed if each[1] not in ("", "s")] == []


def test_the_template_has_every_text():
    assert TEMPLATE.read_text(encoding="utf-8") == template()
    assert template().count("<message>") > 60


if __name__ == "__main__":
    TEMPLATE.write_text(template(), encoding="utf-8")
