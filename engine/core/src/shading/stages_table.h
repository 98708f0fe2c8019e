// The stages for the instruction set that this is compiled for.
#pragma once
#include "program/run.h"
#include "shading/stage_camera.h"
#include "shading/stage_dome.h"
#include "shading/stage_evaluate.h"
#include "shading/stage_gather.h"
#include "shading/stage_light.h"
#include "shading/stage_pass.h"
#include "shading/stage_shade.h"
#include "shading/stage_share.h"
#include "shading/stage_sum.h"
#include "shading/stage_surface.h"
#include "shading/stage_transmittance.h"

namespace glint {
namespace {

constexpr Stages stages_named(const char* name) {
  return {name,  camera,   surface, shade,     vary,  run_program, coefficients,
          pass,  dome,     light,   scatter,   gloss, gather,      reflect,
          share, transmit, sum,     sum_parts, add,   mean,        cosine_powers};
}

}  // namespace
}  // namespace glint
