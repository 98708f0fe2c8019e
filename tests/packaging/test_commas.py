"""The check for statements that commas join, on what looks like one and on what is one."""

import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.once

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def commas():
    sys.path.insert(0, str(ROOT / "packaging"))
    try:
        import commas as module
    finally:
        sys.path.pop(0)
    return module


@pytest.mark.parametrize(
    "text",
    [
        "void f() { a = 1, b = 2; }",
        "void f() { if (x) a.b = 1, c[k] = 2; }",
        "void f() { for (int i = 0; i < 3; ++i) p.x[i] = 1, q = f(i); }",
        "void f() { ++a, --b; }",
        "int f() { return g(x), 1; }",
        "void f() { std::sort(a, b), c = 1; }",
        "void f() { g<2>(a), h(b); }",
        "void f() { run([&](int k) { a = k, b = k; }); }",
        "struct S { void g() { low = min(low, p), high = max(high, p); } };",
    ],
)
def test_joined_statements_are_found(commas, text: str) -> None:
    assert len([*commas.joined_statements(text)]) == 1


@pytest.mark.parametrize(
    "text",
    [
        "double a = 1, b = 2;",
        "const std::vector<std::pair<int, float>>&a = x, &b = y;",
        "alignas(64) float near[8], far[8];",
        "void f() { for (int i = 0, j = 1; i < j; ++i, --j) g(i, j); }",
        "enum { A, B, C };",
        "struct S : A, B { S() : a(1), b{2} {} int c, d; };",
        "void f() { x = {a, b}; g(a, b); return h<int, 3>(a, b); }",
        "auto f = [a, &b](int c, int d) { return c < d; };",
        "void f() { // a = 1, b = 2;\n}",
        "#define JOIN(a, b) a = 1, b = 2;\nint x = f(\"a, b;\", ',');",
    ],
)
def test_other_commas_are_not(commas, text: str) -> None:
    assert not [*commas.joined_statements(text)]
