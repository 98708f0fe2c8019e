// A test is a function in a group; check() counts what fails and goes on.
#pragma once
#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace glint::test {

struct Test {
  const char* group;
  const char* name;
  void (*body)();
  Test* next;
  Test(const char* group, const char* name, void (*body)());
};

inline int failures = 0;

/// How many of `n` rounds a test makes, or how large what it builds is: where sanitizers watch, and
/// each takes several times as long, a fifth of them, or as many as it needs, reads what all would.
constexpr int rounds(int n, [[maybe_unused]] int least = 0) {
#ifdef GLINT_SANITIZED
  return std::max((n + 4) / 5, least);
#else
  return n;
#endif
}

inline void check(bool good, const char* what, const char* file, int line) {
  if (good) return;
  if (++failures <= 20) std::fprintf(stderr, "%s:%d: %s\n", file, line, what);
}

/// What the core reads as GLINT_ISA from now on; null: what is best.
inline void ask_for_isa(const char* isa) {
#if defined(_WIN32)
  _putenv_s("GLINT_ISA", isa ? isa : "");
#else
  isa ? setenv("GLINT_ISA", isa, 1) : unsetenv("GLINT_ISA");
#endif
}

}  // namespace glint::test

#define TEST(group, name)                                                         \
  static void group##_##name();                                                   \
  static glint::test::Test group##_##name##_entry(#group, #name, group##_##name); \
  static void group##_##name()
#define CHECK(condition) glint::test::check(condition, #condition, __FILE__, __LINE__)
