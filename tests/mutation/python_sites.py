"""Mutation sites of Python files, found in their syntax trees."""

import ast

import sites

_IMPORT = b"from touchstone._mutant import on as _mutant_on\n"
_COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_ARITHMETIC = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_LOGIC = {ast.And: "and", ast.Or: "or"}


class File:
    def __init__(self, path):
        with open(path, "rb") as file:
            self.source = file.read()
        self._tree = ast.parse(self.source)
        self._begins = [0]
        for line in self.source.split(b"\n"):
            self._begins.append(self._begins[-1] + len(line) + 1)

    def sites(self):
        found = []
        self._walk(self._tree, found)
        return sorted(found, key=lambda site: site.operator_begin)

    def compiles(self, number, mutant):
        try:
            compile(mutated(self.source, number, mutant), "mutated", "exec")
        except SyntaxError:
            return False
        return True

    def _walk(self, node, found):
        if isinstance(node, ast.JoinedStr):
            return  # places within an f-string are not told
        site = self._site(node)
        if site:
            found.append(site)
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "decorator_list", "defaults", "kw_defaults"):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    self._walk(child, found)

    def _site(self, node):
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            return self._operation(node, node.left, node.comparators[0], _COMPARISONS.get(type(node.ops[0])))
        if isinstance(node, ast.BoolOp) and len(node.values) == 2:
            left, right = node.values
            return self._operation(node, left, right, _LOGIC[type(node.op)])
        if isinstance(node, ast.BinOp) and not any(_is_text(side) for side in (node.left, node.right)):
            return self._operation(node, node.left, node.right, _ARITHMETIC.get(type(node.op)))
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            begin, end = self._span(node)
            text = self.source[begin:end].decode()
            changes = sites.changed_constant(text)
            return sites.Site(begin, end, begin, end, node.lineno, text, changes) if changes else None
        return None

    def _operation(self, node, left, right, operator):
        if operator is None:
            return None
        begin, end = self._span(left)[1], self._span(right)[0]
        # Beside the operator stand at most brackets and line ends.
        if self.source[begin:end].strip(b" ()\n\\").decode() != operator:
            return None
        at = begin + self.source[begin:end].index(operator.encode())
        first, last = self._span(node)
        return sites.Site(first, last, at, at + len(operator), self.source.count(b"\n", 0, at) + 1, operator,
                          sites.OPERATORS[operator])

    def _span(self, node):
        return self._begins[node.lineno - 1] + node.col_offset, self._begins[node.end_lineno - 1] + node.end_col_offset


def _is_text(node):
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, (str, bytes)))


def mutated(source, number, mutant):
    """The file with both ways of the expression. The import follows the docstring and imports from __future__."""
    original, changed = mutant.texts(source)
    both = b"((%s) if _mutant_on(%d) else (%s))" % (changed, number, original)
    text = source[:mutant.site.begin] + both + source[mutant.site.end:]
    head = 0
    for index, node in enumerate(ast.parse(source).body):
        docstring = index == 0 and isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if not docstring and not (isinstance(node, ast.ImportFrom) and node.module == "__future__"):
            break
        head = node.end_lineno
    lines = text.split(b"\n")
    return b"\n".join(lines[:head]) + b"\n" * (head > 0) + _IMPORT + b"\n".join(lines[head:])
