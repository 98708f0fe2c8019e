#if defined(GLINT_X86_KERNELS)
#include "bvh/traverse/kernel.h"
#include "bvh/traverse/kernel_traverse.h"

namespace glint {
extern const Kernel kernel_sse42{"sse42", closest, occluded};
}
#endif
