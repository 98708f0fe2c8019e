#include "shading/stages.h"

#include "math/math.h"
#include "simd/isa.h"

namespace glint {

#if defined(GLINT_X86_KERNELS)
// Names of those that are compiled (GLINT_STAGES in CMakeLists.txt).
const Stages& best_stages() { return chosen(stages_for_sse42, stages_for_avx2, stages_for_avx512); }
#else
const Stages& best_stages() { return stages_generic; }
#endif

double cosine_power(double tangent2, double p) {
  double power = 0;
  best_stages().cosine_power(&tangent2, &p, &power, 1);
  return power;
}

}  // namespace glint
