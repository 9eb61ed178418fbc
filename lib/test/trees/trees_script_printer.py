"""From a Program back to text, in the one form that all of BT.CPP 4 read alike: with a bracket wherever they don't agree."""

from __future__ import annotations

from alula.trees.script.program import Program
from alula.trees.script.syntax import Assignment, Call, Chain, Comparison, Conditional, Literal, Name, Node, Prefix


def print_program(program: Program) -> str:
    """Return a script's text: one space around operators, single quotes, what is compound in brackets."""
    return "; ".join(_text(statement) for statement in program.statements)


def _text(node: Node) -> str:
    match node:
        case Literal():
            return literal_text(node.value)
        case Name():
            return node.name
        case Call():
            return f"{node.function}({', '.join(_text(argument) for argument in node.arguments)})"
        case Prefix():
            return node.operator + _operand(node.operand)
        case Chain(operators=operators) if set(operators) <= {"&&", "||"}:
            return _joined(node, [_text(one) if _stands_bare(one) else _operand(one) for one in node.operands])
        case Chain() | Comparison():
            return _printed_chain(node)
        case Conditional():
            return f"{_operand(node.condition)} ? {_operand(node.then)} : {_operand(node.otherwise)}"
        case Assignment():
            value = _text(node.value) if not isinstance(node.value, Assignment) else _operand(node.value)
            return f"{_operand(node.target)} {node.operator} {value}"


def _stands_bare(node: Node) -> bool:
    """Return whether an operand of `&&` needs no brackets: a comparison, `!x`."""
    return isinstance(node, Comparison) or (isinstance(node, Prefix) and node.operator != "-")


def _printed_chain(node: Chain | Comparison) -> str:
    operands = [_operand(operand) for operand in node.operands]
    if isinstance(node, Chain) and set(node.operators) & {"-", "/"}:
        # 4.8 would read a longer chain from the right.
        text = operands[0]
        for number, (symbol, operand) in enumerate(zip(node.operators, operands[1:], strict=True)):
            text = f"({text}) {symbol} {operand}" if number else f"{text} {symbol} {operand}"
        return text
    return _joined(node, operands)


def _joined(node: Chain | Comparison, operands: list[str]) -> str:
    pairs = zip(node.operators, operands[1:], strict=True)
    return operands[0] + "".join(f" {symbol} {operand}" for symbol, operand in pairs)


def _operand(node: Node) -> str:
    return _text(node) if isinstance(node, Literal | Name | Call) else f"({_text(node)})"


def literal_text(value: float | str) -> str:
    """Return the text of a number (with a point where it is no integer) or of a text.

    No script can hold a text with both kinds of quotes.
    """
    if isinstance(value, str):
        return f'"{value}"' if "'" in value else f"'{value}'"
    return str(value) if isinstance(value, int) else repr(float(value))
