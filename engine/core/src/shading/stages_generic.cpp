#if !defined(GLINT_X86_KERNELS)
#include "program/run.h"
#include "shading/stage_camera.h"
#include "shading/stage_evaluate.h"
#include "shading/stage_light.h"
#include "shading/stage_pass.h"
#include "shading/stage_shade.h"
#include "shading/stage_share.h"
#include "shading/stage_surface.h"
#include "shading/stage_transmittance.h"

namespace glint {
extern const Stages stages_generic{"generic", camera,  surface,      shade,    vary,  run_program,
                                   pass,      dome,    light,        scatter,  gloss, gather,
                                   matten,    reflect, share,        transmit, sum,   sum_parts,
                                   add,       mean,    cosine_powers};
}
#endif
