// The kernels that tests take one after the other.
#pragma once
#include <string>
#include <vector>

#include "bvh/traverse/kernel.h"
#include "check.h"

namespace glint::test {

/// The kernel that runs when `isa` is asked for.
inline std::string kernel_for(const char* isa) {
  ask_for_isa(isa);
  const std::string name = best_kernel().name;
  ask_for_isa(nullptr);
  return name;
}

/// Kernels that are compiled and that this machine runs.
inline std::vector<std::string> kernels_here() {
// Zig's library lacks what the builtin asks; a build that sanitizers watch has one kernel.
#if defined(__x86_64__) && (defined(GLINT_ZIG) || defined(GLINT_SANITIZED))
  std::vector<std::string> names{"sse42", "avx2", "avx512"};
  std::erase_if(names, [](const std::string& isa) { return kernel_for(isa.c_str()) != isa; });
  return names;
#elif defined(__x86_64__)
  std::vector<std::string> names{"sse42"};
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2")) names.push_back("avx2");
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw"))
    names.push_back("avx512");
  return names;
#else
  return {"generic"};
#endif
}

}  // namespace glint::test
