#if !defined(GLINT_X86_KERNELS)
#include "stage_camera.h"
#include "stage_light.h"
#include "stage_pass.h"
#include "stage_shade.h"
#include "stage_surface.h"
#include "stage_vary.h"
#include "stage_veil.h"

namespace glint {
extern const Stages stages_generic{"generic", camera, surface, shade,        vary,
                                   pass,      light,  gloss,   veil,         sum,
                                   sum_parts, add,    mean,    cosine_powers};
}
#endif
