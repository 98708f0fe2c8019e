// Which instruction set to use, chosen when the code runs.
#pragma once
#if defined(GLINT_X86_KERNELS)
#include <cpuid.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace glint {

enum Isa { kSse42, kAvx2, kAvx512 };

/// The best one that the processor has and whose registers the system keeps. By hand, because
/// __builtin_cpu_supports needs a variable of the compiler's own library, which Zig's lacks.
inline Isa machine_isa() {
  unsigned a = 0, b = 0, c = 0, d = 0, kept = 0;
  if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE) || !(c & bit_FMA)) return kSse42;
  __asm__("xgetbv" : "=a"(kept), "=d"(d) : "c"(0));
  if (!__get_cpuid_count(7, 0, &a, &b, &c, &d)) return kSse42;
  const auto has = [&](unsigned features, unsigned registers) {
    return (b & features) == features && (kept & registers) == registers;
  };
  const unsigned ymm = 0x06, zmm = 0xe6;
  if (!has(bit_AVX2 | bit_BMI | bit_BMI2, ymm)) return kSse42;
  return has(bit_AVX512F | bit_AVX512VL | bit_AVX512DQ | bit_AVX512BW, zmm) ? kAvx512 : kAvx2;
}

/// The best one, or what the environment variable GLINT_ISA (sse42, avx2 or avx512) names, but
/// nothing that this machine lacks.
inline Isa choose_isa() {
  Isa isa = kAvx512;
  const char* wish = std::getenv("GLINT_ISA");
  const char* const names[] = {"sse42", "avx2", "avx512"};
  for (int k = 0; wish && k < 3; ++k)
    if (std::strcmp(wish, names[k]) == 0) isa = Isa(k);
  return std::min(isa, machine_isa());
}

/// The one of the same for each instruction set that choose_isa() says.
template <class T>
const T& chosen(const T& sse42, const T& avx2, const T& avx512) {
  const Isa isa = choose_isa();
  return isa == kAvx512 ? avx512 : isa == kAvx2 ? avx2 : sse42;
}

}  // namespace glint
#endif
