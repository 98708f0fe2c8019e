#include "stages.h"

#include <cstdlib>
#include <cstring>

#include "../math.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
const Stages& best_stages() {
  __builtin_cpu_init();
  const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
  const bool avx512 = avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw");
  const char* wish = std::getenv("GLINT_ISA");
  auto wished = [wish](const char* name) { return wish && std::strcmp(wish, name) == 0; };
  if (!avx2 || wished("sse42")) return stages_sse42;
  return !avx512 || wished("avx2") ? stages_avx2 : stages_avx512;
}
#else
const Stages& best_stages() { return stages_generic; }
#endif

double cosine_power(double tangent2, double p) {
  double power = 0;
  best_stages().cosine_power(&tangent2, &p, &power, 1);
  return power;
}

}  // namespace glint
