// One sample of each pixel of one scene, for counting instructions: pipeline_counts NAME. Whatever
// has "beside" in its name is the plain scene with something in it that no ray meets, or a setting
// that nothing reads. Everything to be counted happens inside glint_counted_region (valgrind
// --tool=callgrind --toggle-collect=glint_counted_region). Prints how many pixels that were, and
// the compiler; tests/bench/features.py runs it.
#include <cstdio>
#include <string>

#include "integrator/tracer.h"
#include "pipeline_scenes.h"

using namespace glint;
using namespace glint::bench;

namespace {

const std::vector<int> kDull = {GLINT_DIFFUSE, GLINT_AMBIENT};
const std::vector<int> kShiny = {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_SPECULAR},
                       kMirroring = {GLINT_DIFFUSE, GLINT_AMBIENT, GLINT_MIRROR};
const std::vector<int> kEachLobe = {
    GLINT_DIFFUSE,      GLINT_AMBIENT,       GLINT_SPECULAR,   GLINT_SHEEN,
    GLINT_TOON_DIFFUSE, GLINT_TOON_SPECULAR, GLINT_OREN_NAYAR, GLINT_OREN_NAYAR_MULTIPLE};
const std::vector<int> kGlass = {GLINT_REFRACTION, GLINT_MIRROR},
                       kVeil = {GLINT_DIFFUSE, GLINT_TRANSPARENT};

/// A dull grid and one light of 4 samples that needs no shadow rays.
Variant soft(const char* name, int kind, double extent, uint32_t flags = 0) {
  return {name, false, false, kDull, {kind}, extent, 4, kDull, false, false, flags};
}

/// The plain scene with something else.
Variant special(const char* name, Variant::Special what, const std::vector<int>& unseen = kDull,
                bool smooth = false) {
  Variant v{name, smooth, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, unseen};
  v.special = what;
  return v;
}

const Variant kVariants[] = {
    {"plain", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kDull},
    {"highlights", false, false, kShiny, {GLINT_POINT_LIGHT}, 0, 1, kDull},
    {"highlights beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kShiny},
    {"lobes", false, false, kEachLobe, {GLINT_POINT_LIGHT}, 0, 1, kDull},
    {"lobes beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kEachLobe},
    {"mirror", false, false, kMirroring, {GLINT_POINT_LIGHT}, 0, 1, kDull},
    {"mirror beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kMirroring},
    {"glass", false, false, kGlass, {GLINT_POINT_LIGHT}, 0, 1, kDull},
    {"glass beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kGlass},
    {"alpha", false, false, kVeil, {GLINT_POINT_LIGHT}, 0, 1, kDull},
    {"alpha beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kVeil},
    {"texture", false, true, kDull, {GLINT_POINT_LIGHT}, 0, 1, kDull},
    {"texture beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kDull, true},
    {"sphere beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 1, kDull, false, true},
    special("smooth", Variant::kNone, kDull, true),
    special("smooth beside", Variant::kSmooth),
    special("offsets beside", Variant::kOffsets),
    special("hair beside", Variant::kStrands),
    special("medium beside", Variant::kMedium),
    special("middle of a lens", Variant::kLens),
    special("resting camera frames", Variant::kMotion),
    {"no light", false, false, kDull, {}, 0, 1, kDull},
    soft("sun", GLINT_SUN, 0.1),
    soft("sphere", GLINT_POINT_LIGHT, 0.4),
    soft("disc", GLINT_POINT_LIGHT, 0.4, GLINT_SOFT_FALLOFF),
    soft("rectangle", GLINT_AREA, 0.8),
    soft("near rectangle", GLINT_AREA, 4),
    soft("ellipse", GLINT_AREA, 0.8, GLINT_ELLIPSE),
    {"soft light, 4 samples", false, false, kDull, {GLINT_POINT_LIGHT}, 0.4, 4, kDull},
    {"4 light samples beside", false, false, kDull, {GLINT_POINT_LIGHT}, 0, 4, kDull},
};

}  // namespace

extern "C" __attribute__((noinline, visibility("default"))) void glint_counted_region(
    Tracer& tracer, const Film& film) {
  for (const Tile& tile : film.tiles()) {
    tracer.choose(tile);
    tracer.trace(1, 2);
  }
}

int main(int argc, char** argv) {
  const Grid grid(40);
  for (const Variant& v : kVariants) {
    if (argc != 2 || std::string(argv[1]) != v.name) continue;
    const Description description(grid, v);
    const std::atomic<bool> go_on{false};
    Scene scene(description.data);
    scene.build(1, BuildQuality::kBalanced, go_on);
    const Plan plan(v, {320, 180, 640, 360});
    Film film(plan.region, 1);
    Tracer tracer(scene, plan, film, go_on);
    glint_counted_region(tracer, film);
    std::printf("%zu %s\n", size_t(plan.region.width()) * plan.region.height(), __VERSION__);
    return 0;
  }
  std::fprintf(stderr, "pipeline_counts: one of the scenes in pipeline_counts.cpp, please\n");
  return 1;
}
