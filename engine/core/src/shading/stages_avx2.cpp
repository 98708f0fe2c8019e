#if defined(GLINT_X86_KERNELS)
#include "shading/stages_table.h"

namespace glint {
extern constinit const Stages stages_avx2 = stages_named("avx2");
}
#endif
