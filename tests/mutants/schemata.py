"""Mutant schemata: one source text that holds every mutant of a Rust file, each behind a switch at run time.

The operators are those of cargo-mutants: bodies of functions, binary operators, unary operators, match arms and
guards, fields before a base expression. Patterns, constants, attributes, macros and tests stay as they are.
"""

import itertools
import re
from dataclasses import dataclass

import tree_sitter_rust
from tree_sitter import Language, Parser

PARSER = Parser(Language(tree_sitter_rust.language()))

BINARY = {
    "==": ["!="], "!=": ["=="], "&&": ["||"], "||": ["&&"],
    "<": ["==", ">", "<="], ">": ["==", "<", ">="], "<=": [">"], ">=": ["<"],
    "+": ["-", "*"], "-": ["+", "/"], "*": ["+", "/"], "/": ["%", "*"], "%": ["/", "+"],
    "<<": [">>"], ">>": ["<<"], "&": ["|", "^"], "|": ["&", "^"], "^": ["&", "|"],
}
COMPARISONS = {"==", "!=", "<", ">", "<=", ">="}
COMPOUND = {
    "+=": ["-=", "*="], "-=": ["+=", "/="], "*=": ["+=", "/="], "/=": ["%=", "*="], "%=": ["/=", "+="],
    "<<=": [">>="], ">>=": ["<<="], "&=": ["|=", "^="], "|=": ["&=", "^="], "^=": ["&=", "|="],
}
# What has no expression that could be switched at run time.
VERBATIM = {
    "attribute_item", "inner_attribute_item", "const_item", "static_item", "macro_invocation", "macro_definition",
    "array_type", "const_block", "enum_item", "struct_item", "use_declaration", "type_item", "closure_parameters",
    "parameters", "line_comment", "block_comment",
}
SIGNED = {"i8", "i16", "i32", "i64", "i128", "isize"}
UNSIGNED = {"u8", "u16", "u32", "u64", "u128", "usize"}
ANY = "Default::default()"
# What is put in place of a product of values at most.
VALUES = 12


@dataclass
class Mutant:
    """One change of one place."""

    number: int
    file: str
    line: int
    column: int
    function: str
    kind: str
    change: str
    code: str

    @property
    def name(self):
        """What it is called in the results: the same as long as the code above it is the same."""
        return f"{self.file}:{self.line}:{self.column}: {self.change} in {self.function}"


class Schemata:
    """Numbers the mutants of one file after another, and writes the switched text of each."""

    def __init__(self, dropped=()):
        self.dropped = set(dropped)
        self.mutants = []

    def rewrite(self, file, source, only=None):
        """The text of `file` with all its mutants; `only` names functions or `impl X` to which they are confined."""
        self.file, self.source, self.only = file, source.encode(), only
        self.lines = source.splitlines()
        self.where, self.function = [], ""
        return self.render(PARSER.parse(self.source).root_node)

    # --- text ---

    def text(self, node):
        return self.source[node.start_byte:node.end_byte].decode()

    def render(self, node):
        if node.type in VERBATIM or node.child_count == 0:
            return self.text(node)
        special = getattr(self, "render_" + node.type, None)
        return special(node) if special and self.is_wanted() else self.children(node)

    def is_wanted(self):
        return self.only is None or any(place in self.only for place in self.where + [self.function])

    def children(self, node, replaced=None):
        """The node with its children rendered, but for those that are `replaced`, by their start."""
        out, at, test = [], node.start_byte, False
        for child in node.children:
            out.append(self.source[at:child.start_byte].decode())
            at = child.end_byte
            if replaced and child.start_byte in replaced:
                out.append(replaced[child.start_byte])
            elif child.type == "attribute_item":
                test = test or re.search(r"\btest\b", self.text(child)) is not None
                out.append(self.text(child))
            elif child.type in ("line_comment", "block_comment"):
                out.append(self.text(child))
            else:
                out.append(self.text(child) if test else self.scoped(child))
                test = False
        out.append(self.source[at:node.end_byte].decode())
        return "".join(out)

    def scoped(self, node):
        """Renders a child, with the names of what it stands in."""
        if node.type == "impl_item":
            kind, of = node.child_by_field_name("type"), node.child_by_field_name("trait")
            name = self.text(kind)
            self.where.append(f"impl {self.text(of)} for {name}" if of else f"impl {name}")
            out = self.children(node)
            self.where.pop()
            return out
        if node.type == "function_item":
            return self.function_item(node)
        return self.render(node)

    # --- mutants ---

    def note(self, node, kind, changes):
        """New mutants of a place; those that build, with their numbers."""
        kept = []
        row, column = node.start_point
        for change, replacement in changes:
            code = self.lines[row].strip()
            mutant = Mutant(len(self.mutants) + 1, self.file, row + 1, column + 1, self.function, kind, change, code)
            self.mutants.append(mutant)
            if mutant.number not in self.dropped:
                kept.append((mutant.number, replacement))
        return kept

    @staticmethod
    def switch(kept, original):
        """A match over the switch: the original first, because the first arm says the type."""
        numbers = ", ".join(str(number) for number, _ in kept)
        arms = [f"0 => {original}"]
        for i, (number, replacement) in enumerate(kept, 1):
            pattern = "_" if i == len(kept) else str(i)
            arms.append(f"{pattern} => {{/*<{number}*/ {replacement} /*>{number}*/}}")
        return f"match crate::mutants::pick(&[{numbers}]) {{ {', '.join(arms)} }}"

    @staticmethod
    def site(kept, text):
        numbers = " ".join(str(number) for number, _ in kept)
        return f"/*[{numbers}*/({text})/*]{numbers}*/"

    def function_item(self, node):
        name = self.text(node.child_by_field_name("name"))
        before, place = self.function, self.where[-1] if self.where else ""
        of = re.fullmatch(r"impl (\w+)(<.*>)?", place)
        self.function = f"{of[1]}::{name}" if of else f"<{place}>::{name}" if place else name
        modifiers = [self.text(c) for c in node.children if c.type == "function_modifiers"]
        out = self.text(node) if "const" in " ".join(modifiers).split() else self.rendered_function(node)
        self.function = before
        return out

    def rendered_function(self, node):
        body, kind = node.child_by_field_name("body"), node.child_by_field_name("return_type")
        shown = f" -> {self.text(kind)}" if kind else ""
        kept = []
        if self.is_wanted() and body.named_child_count and not self.function.endswith("for Default>::default"):
            own = self.text(body)[1:-1].strip()
            values = [v for v in self.values(kind) if v != own]
            changes = [(f"replace{shown} with {v}", f"return {v}" if kind else "return") for v in values]
            kept = self.note(body, "function body", changes)
        inner = self.children(body)
        if kept:
            inner = "{" + f" {self.site(kept, self.switch(kept, '{}'))}; " + inner[1:]
        return self.children(node, {body.start_byte: inner})

    # --- values of a type ---

    def values(self, kind):
        """Values to return in place of a body, as cargo-mutants chooses them; none where a switch cannot."""
        if kind is None:
            return ["()"]
        text = self.text(kind)
        if text == "bool":
            return ["true", "false"]
        if text == "f64" or text == "f32":
            return ["0.0", "1.0", "-1.0"]
        if text in SIGNED:
            return ["0", "1", "-1"]
        if text in UNSIGNED:
            return ["0", "1"]
        if text == "String":
            return ["String::new()", '"xyzzy".into()']
        return getattr(self, "values_" + kind.type, lambda _: [])(kind)

    def values_unit_type(self, _):
        return ["()"]

    def values_type_identifier(self, _):
        return [ANY]

    def values_scoped_type_identifier(self, kind):
        return [f"Ok({ANY})"] if self.text(kind).endswith("::Result") else [ANY]

    def values_reference_type(self, kind):
        of = kind.child_by_field_name("type")
        if self.text(of) == "str":
            return ['""', '"xyzzy"']
        if of.type == "array_type" and not of.child_by_field_name("length"):
            items = self.values(of.child_by_field_name("element"))
            return ["Vec::leak(Vec::new())"] + [f"Vec::leak(vec![{v}])" for v in items]
        return [f"Box::leak(Box::new({v}))" for v in self.values(of)]

    def values_tuple_type(self, kind):
        parts = [self.values(part) for part in kind.named_children]
        return [f"({', '.join(v)})" for v in itertools.islice(itertools.product(*parts), VALUES)]

    def values_array_type(self, kind):
        if not kind.child_by_field_name("length"):
            return []
        length = self.text(kind.child_by_field_name("length"))
        return [f"[{v}; {length}]" for v in self.values(kind.child_by_field_name("element"))]

    def values_generic_type(self, kind):
        name = self.text(kind.child_by_field_name("type")).split("::")[-1]
        of = [self.values(a) for a in kind.child_by_field_name("type_arguments").named_children]
        of = of or [[]]
        if name == "Option":
            return ["None"] + [f"Some({v})" for v in of[0]]
        if name == "Result":
            return [f"Ok({v})" for v in of[0]]
        if name == "Vec":
            return ["vec![]"] + [f"vec![{v}]" for v in of[0]]
        if name in ("Box", "Arc", "Rc"):
            return [f"{name}::new({v})" for v in of[0]]
        return [ANY]

    # --- expressions ---

    def render_binary_expression(self, node):
        left, right = (self.render(node.child_by_field_name(side)) for side in ("left", "right"))
        sign = self.text(node.child_by_field_name("operator"))
        operator = node.child_by_field_name("operator")
        kept = self.note(operator, "binary operator", [(f"replace {sign} with {s}", s) for s in BINARY.get(sign, [])])
        if not kept:
            return f"{left} {sign} {right}"
        if sign in ("&&", "||"):
            # The right side is evaluated once and only if it decides: a && b, or a || b.
            number, stop = kept[0][0], "true" if sign == "||" else "false"
            test = f"crate::mutants::on({number})"
            return self.site(kept, f"{{ let __l: bool = {left}; if (__l != {stop}) != {test} {{ {right} }} else {{ __l }} }}")
        if sign in COMPARISONS:
            arms = [(number, f"*__l {s} *__r") for number, s in kept]
            return self.site(kept, f"match (&({left}), &({right})) {{ (__l, __r) => {self.switch(arms, f'*__l {sign} *__r')} }}")
        arms = [(number, f"__l {s} __r") for number, s in kept]
        return self.site(kept, f"match ({left}, {right}) {{ (__l, __r) => {self.switch(arms, f'__l {sign} __r')} }}")

    def render_compound_assignment_expr(self, node):
        left, right = (self.render(node.child_by_field_name(side)) for side in ("left", "right"))
        operator = node.child_by_field_name("operator")
        sign = self.text(operator)
        changes = [(f"replace {sign} with {s}", f"{left} {s} __r") for s in COMPOUND.get(sign, [])]
        kept = self.note(operator, "binary operator", changes)
        if not kept:
            return f"{left} {sign} {right}"
        return self.site(kept, f"match ({right}) {{ __r => {self.switch(kept, f'{{ {left} {sign} __r }}')} }}")

    def render_unary_expression(self, node):
        sign, operand = self.text(node.children[0]), self.render(node.children[1])
        kept = self.note(node, "unary operator", [(f"delete {sign}", "__v")] if sign in "-!" else [])
        if not kept:
            return f"{sign}{operand}"
        return self.site(kept, f"match ({operand}) {{ __v => {self.switch(kept, f'{sign}__v')} }}")

    def render_match_block(self, node):
        arms = [child for child in node.children if child.type == "match_arm"]
        patterns = [arm.child_by_field_name("pattern") for arm in arms]
        may_delete = any(self.text(p) == "_" for p in patterns)
        return self.children(node, {arm.start_byte: self.arm(arm, may_delete) for arm in arms})

    def arm(self, node, may_delete):
        whole = node.child_by_field_name("pattern")
        guard = whole.child_by_field_name("condition")
        pattern = self.text(whole if guard is None else whole.children[0])
        tests, kept = [], []
        if may_delete and pattern != "_":
            shown = " ".join(pattern.split())
            kept = self.note(whole, "match arm", [(f"delete match arm {shown}", "")])
            tests = [f"/*<{n}*/!crate::mutants::on({n})/*>{n}*/" for n, _ in kept]
        if guard is not None:
            chain = guard.type in ("let_chain", "let_condition") or "let " in self.text(guard)
            own = self.render(guard)
            changes = [] if chain else [("true", "||"), ("false", "&& !")]
            shown = " ".join(self.text(guard).split())
            switched = self.note(guard, "match guard", [(f"replace match guard {shown} with {v}", v) for v, _ in changes])
            yes = "".join(f"crate::mutants::on({n}) || " for n, v in switched if v == "true")
            no = "".join(f"!crate::mutants::on({n}) && " for n, v in switched if v == "false")
            if switched:
                kept += switched
                own = f"({yes}({no}({own})))"
            tests.append(own)
        head = pattern + (" if " + " && ".join(tests) if tests else "")
        if kept:
            numbers = " ".join(str(n) for n, _ in kept)
            head = f"/*[{numbers}*/{head}/*]{numbers}*/"
        return self.children(node, {whole.start_byte: head})

    def render_struct_expression(self, node):
        fields = node.child_by_field_name("body")
        bases = [f for f in fields.named_children if f.type == "base_field_initializer"]
        if not bases:
            return self.children(node)
        name, base = self.text(node.child_by_field_name("name")), self.text(bases[0].named_children[0])
        base = f"<{name}>::default()" if base == ANY else f"({base})"
        replaced = {}
        for field in fields.named_children:
            if field.type not in ("field_initializer", "shorthand_field_initializer"):
                continue
            value = field.child_by_field_name("value")
            label = self.text(field.child_by_field_name("field") or field) if value else self.text(field)
            kept = self.note(field, "field", [(f"delete field {label} of {name}", f"{base}.{label}")])
            own = self.render(value) if value else label
            text = self.site(kept, self.switch(kept, f"{{ {own} }}")) if kept else own
            replaced[field.start_byte] = f"{label}: {text}"
        body = self.children(fields, replaced)
        return self.children(node, {fields.start_byte: body})


MARK = re.compile(rb"/\*([<>\[\]])([0-9 ]+)\*/")


def blamed(text, errors):
    """The mutants that errors of the compiler are about: those within whose text an error lies, else those of its place.

    `errors` holds for each error a list of (start, end, whether it is the primary span), in bytes of `text`.
    """
    ranges, opened = [], []
    for mark in MARK.finditer(text):
        sign, numbers = mark[1], [int(n) for n in mark[2].split()]
        if sign in b"<[":
            opened.append((sign, mark.start(), numbers))
        else:
            kind, start, numbers = opened.pop()
            ranges.append((kind, start, mark.end(), numbers))
    out, lost = set(), []
    for spans in errors:
        found = (
            innermost(ranges, b"<", [s for s in spans if s[2]])
            or innermost(ranges, b"<", spans)
            or innermost(ranges, b"[", [s for s in spans if s[2]])
            or innermost(ranges, b"[", spans)
        )
        out.update(found)
        if not found:
            lost.append(spans)
    return out, lost


def innermost(ranges, kind, spans):
    """The numbers of the smallest ranges of `kind` around the spans."""
    found = set()
    for start, end, _ in spans:
        around = [r for r in ranges if r[0] == kind and r[1] <= start and end <= r[2]]
        if around:
            found.update(min(around, key=lambda r: r[2] - r[1])[3])
    return found
