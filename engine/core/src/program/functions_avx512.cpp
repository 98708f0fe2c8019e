#if defined(GLINT_X86_KERNELS)
#include "program/functions_table.h"

namespace glint {
extern const NamedFunction* const functions_avx512 = kNamedFunctions;
}
#endif
