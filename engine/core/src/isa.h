// Which instruction set to use, chosen when the code runs.
#pragma once
#if defined(GLINT_X86_KERNELS)
#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace glint {

enum Isa { kSse42, kAvx2, kAvx512 };

/// `unasked`, or what the environment variable GLINT_ISA (sse42, avx2 or avx512) names, but nothing that this machine lacks.
inline Isa choose_isa(Isa unasked) {
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
  const char* wish = std::getenv("GLINT_ISA");
  const char* const names[] = {"sse42", "avx2", "avx512"};
  for (int k = 0; wish && k < 3; ++k)
    if (std::strcmp(wish, names[k]) == 0) unasked = Isa(k);
  return std::min(unasked, avx512 ? kAvx512 : avx2 ? kAvx2 : kSse42);
}

}  // namespace glint
#endif
