// The elementary functions by name, for tests. Plain data only: nothing here may emit code.
#pragma once
#include <cstddef>

namespace glint {

/// out[k] = f(x[k], y[k]); functions of one number leave y alone.
struct NamedFunction {
  const char* name;
  void (*apply)(const double* x, const double* y, double* out, size_t count);
};

/// Tables end with a null name.
#if defined(GLINT_X86_KERNELS)
extern const NamedFunction *const functions_sse42, *const functions_avx2, *const functions_avx512;
#else
extern const NamedFunction* const functions_generic;
#endif

/// Those for this machine, or for what GLINT_ISA names as in best_stages().
const NamedFunction* best_functions();

}  // namespace glint
