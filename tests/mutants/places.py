"""Where a C source can be changed: one operator, number, condition or call, found by tree-sitter's grammar of C."""

import re
from collections import namedtuple

import tree_sitter
import tree_sitter_c

# One change: `after` instead of the octets from start to end.
Place = namedtuple("Place", "file line start end before after")

OPERATORS = {
    "==": ["!="], "!=": ["=="], "<": ["<=", ">="], "<=": ["<", ">"], ">": [">=", "<="], ">=": [">", "<"],
    "&&": ["||"], "||": ["&&"], "+": ["-"], "-": ["+"], "*": ["/"], "/": ["*"], "%": ["/"], "&": ["|"], "|": ["&"],
    "<<": [">>"], ">>": ["<<"], "+=": ["-="], "-=": ["+="], "|=": ["&="], "&=": ["|="], "*=": ["/="], "/=": ["*="],
    "++": ["--"], "--": ["++"]}
NUMBER = re.compile(rb"(0[xX][0-9a-fA-F]+|[0-9]+(?:\.[0-9]*)?(?:[eE][-+]?[0-9]+)?)([uUlLfF]*)")
# What a log line says is for people; nobody promises its words.
LOG = re.compile(rb"log_(error|warning|info|debug)$")
PARSER = tree_sitter.Parser(tree_sitter.Language(tree_sitter_c.language()))


def places(path, name):
    """All changes of that source, in its order."""
    source = path.read_bytes()
    found = []

    def change(node, after, start=None, end=None):
        start, end = node.start_byte if start is None else start, node.end_byte if end is None else end
        found.append(Place(name, source.count(b"\n", 0, start) + 1, start, end, source[start:end].decode(), after))

    walk(PARSER.parse(source).root_node, change)
    return sorted(found, key=lambda place: (place.start, place.end, place.after))


def walk(node, change):
    if node.type == "call_expression" and LOG.match(node.child_by_field_name("function").text):
        return
    if node.type in ("static_assert_declaration", "preproc_include", "string_literal"):
        return
    if node.type in ("binary_expression", "assignment_expression", "update_expression"):
        operator = node.child_by_field_name("operator")
        for other in OPERATORS.get(operator.text.decode(), []):
            change(operator, other)
    if node.type == "unary_expression" and node.child_by_field_name("operator").text == b"!":
        change(node, node.child_by_field_name("argument").text.decode())
    if node.type == "number_literal":
        numbers(node.text, 0, node, change)
    if node.type == "preproc_arg":  # the text of a #define isn't parsed
        for match in re.finditer(rb"(?<![\w.\"])" + NUMBER.pattern + rb"(?!\w)", node.text.split(b"/*")[0]):
            numbers(match[0], match.start(), node, change)
    if node.type in ("true", "false"):
        change(node, "false" if node.type == "true" else "true")
    if node.type in ("if_statement", "while_statement", "for_statement", "conditional_expression"):
        condition = node.child_by_field_name("condition")
        if condition is not None and condition.type not in ("true", "number_literal"):
            text = condition.text.decode()
            change(condition, f"(!({text}))")
    if node.type == "expression_statement" and node.named_child_count and node.named_child(0).type == "call_expression":
        if not LOG.match(node.named_child(0).child_by_field_name("function").text):
            change(node, ";")
    for child in node.children:
        walk(child, change)


def numbers(text, at, node, change):
    """One more and one less."""
    match = NUMBER.fullmatch(text)
    if match is None:
        return
    digits, suffix = match[1].decode(), match[2].decode()
    start = node.start_byte + at
    if digits.lower().startswith("0x"):
        others = [f"0x{int(digits, 16) + 1:X}"]
    elif digits.isdigit():
        value = int(digits, 10)
        others = [str(value + 1)] + ([str(value - 1)] if value else [])
    else:
        others = [repr(float(digits) * 1.1)]
    for other in others:
        change(node, other + suffix, start, start + len(text))
