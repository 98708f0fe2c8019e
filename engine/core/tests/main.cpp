// accel_tests [group]: runs all tests, or those of a group; exit code 1 when one fails or the group
// is empty.
#include <chrono>
#include <cstring>

#include "check.h"

namespace glint::test {
namespace {
Test* tests = nullptr;
}
Test::Test(const char* group_, const char* name_, void (*body_)())
    : group(group_), name(name_), body(body_), next(tests) {
  tests = this;
}
}  // namespace glint::test

int main(int argc, char** argv) {
  using namespace glint::test;
  int run = 0, failed = 0;
  for (const Test* t = tests; t; t = t->next) {
    if (argc > 1 && std::strcmp(argv[1], t->group) != 0) continue;
    const auto start = std::chrono::steady_clock::now();
    failures = 0;
    t->body();
    const double s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    std::printf("%-6s %s.%s (%.2f s)\n", failures ? "FAILED" : "ok", t->group, t->name, s);
    ++run;
    failed += failures > 0;
  }
  std::printf("%d tests, %d failed\n", run, failed);
  return run == 0 || failed > 0;
}
