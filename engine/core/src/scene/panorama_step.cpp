#include "scene/panorama_step.h"

#include "shading/panorama.h"

namespace glint {

double panorama_step(const GlintCamera& camera) {
  const double* w = camera.window;
  const double u = 0.5 * (w[0] + w[1]), v = 0.5 * (w[2] + w[3]),
               pixel = (w[1] - w[0]) / camera.width;
  const Look here = sound_look_of(camera, splat(u), splat(v)),
             next = sound_look_of(camera, splat(u + pixel), splat(v));
  const double step = length(next.d - here.d)[0];
  const bool known = here.seen[0] && next.seen[0] && step > 0;
  return 0.1 * (known ? step : 6.28318530717958647693 / camera.width);
}

}  // namespace glint
