// Nanoseconds a pixel sample, tracing apart from all the rest, on one thread:
//   pipeline_bench [quads a side, default 300] [name of a scene]
// Each tile is traced several times and the least time taken, so that other work on the machine is
// left out.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "integrator/tracer.h"
#include "pipeline_scenes.h"
#include "system/timer.h"

namespace {

using namespace glint;
using namespace glint::bench;

constexpr int kRepeats = 7;

const Variant kVariants[] = {
    {"sun", false, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_SUN}, 0, 1},
    {"point", false, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0, 1},
    {"smooth", true, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0, 1},
    {"phong",
     true,
     false,
     {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_SPECULAR},
     {GLINT_POINT_LIGHT},
     0,
     1},
    {"textured", true, true, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0, 1},
    {"three lights",
     true,
     false,
     {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_SPECULAR},
     {GLINT_POINT_LIGHT, GLINT_SUN, GLINT_SPOT},
     0,
     1},
    {"soft, 16 samples", true, false, {GLINT_DIFFUSE, GLINT_AMBIENT}, {GLINT_POINT_LIGHT}, 0.4, 16},
    {"mirror",
     true,
     false,
     {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_MIRROR},
     {GLINT_POINT_LIGHT},
     0,
     1},
    {"glass", true, false, {GLINT_REFRACTION, GLINT_MIRROR}, {GLINT_POINT_LIGHT}, 0, 1},
    {"veil", true, false, {GLINT_DIFFUSE, GLINT_TRANSPARENT}, {GLINT_POINT_LIGHT}, 0, 1},
};

struct Seconds {
  double all = 0, tracing = 0;
};

/// The least time of several tries for each tile, summed over the tiles.
Seconds measure(Tracer& tracer, const Film& film) {
  Seconds sum;
  for (const Tile& tile : film.tiles()) {
    Seconds best{1e9, 0};
    tracer.choose(tile);
    for (int k = 0; k < kRepeats; ++k) {
      const double before = tracer.counts().tracing;
      double all = 0;
      {
        const Timer timer(all);
        tracer.trace(1, 2);
      }
      if (all < best.all) best = {all, tracer.counts().tracing - before};
    }
    sum.all += best.all;
    sum.tracing += best.tracing;
  }
  return sum;
}

void run(const Grid& grid, const Variant& v) {
  const Description description(grid, v);
  const std::atomic<bool> go_on{false};
  Scene scene(description.data);
  scene.build(1, BuildQuality::kBalanced, go_on);
  const Plan plan(v, {0, 0, kWidth, kHeight});
  Film film(plan.region, 1);
  Tracer tracer(scene, plan, film, go_on);
  const Seconds s = measure(tracer, film);
  const double pixels = double(kWidth) * kHeight, rays = kRepeats * pixels;
  const RayCounts& c = tracer.counts();
  const double others = double(c.mirror + c.refraction + c.transparent) / rays;
  std::printf(
      "%-18s %7.1f ns = tracing %7.1f + rest %7.1f;  rays: camera 1, shadow %.2f, others %.2f\n",
      v.name, 1e9 * s.all / pixels, 1e9 * s.tracing / pixels, 1e9 * (s.all - s.tracing) / pixels,
      double(c.shadow) / rays, others);
}

}  // namespace

int main(int argc, char** argv) {
  const Grid grid(argc > 1 ? uint32_t(std::atoi(argv[1])) : 300);
  for (const Variant& v : kVariants)
    if (argc <= 2 || std::strcmp(argv[2], v.name) == 0) run(grid, v);
}
