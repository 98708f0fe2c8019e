#if !defined(GLINT_X86_KERNELS)
#include "shading/stages_table.h"

namespace glint {
extern constinit const Stages stages_generic = stages_named("generic");
}
#endif
