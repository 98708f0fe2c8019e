// The traversal kernels: one source (kernel_*.h), compiled once per instruction set, with the same
// bits from each.
#pragma once
#include "bvh/accel.h"
#include "bvh/bvh.h"

namespace glint {

struct Kernel {
  const char* name;
  void (*closest)(const TopLevelView&, const Rays&, const Hits&, RayStacks&);
  void (*occluded)(const TopLevelView&, const Rays&, uint8_t*, const Layers*,
                   RayStacks&);  // layers: or null
};

#if defined(GLINT_X86_KERNELS)
extern const Kernel kernel_sse42, kernel_avx2, kernel_avx512;
#else
extern const Kernel kernel_generic;
#endif

/// The fastest kernel that this machine runs. The environment variable GLINT_ISA (sse42, avx2 or
/// avx512) takes another one where the machine has it.
const Kernel& best_kernel();

}  // namespace glint
