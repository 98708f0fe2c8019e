// One kind of work on a fixed mesh, for counting instructions: ray_counts
// primary|shadow|shadow_from_light|mirror|diffuse|build. Everything to be counted happens inside
// glint_counted_region (valgrind --tool=callgrind --toggle-collect=glint_counted_region). Prints
// how many rays (build: triangles) that were, and the compiler; tests/bench/instructions.py runs
// it.
#include <cstdio>

#include "ray_sets.h"

using namespace glint;
using namespace glint::bench;

namespace {

struct Work {
  const World& world;
  const Accel* accel;  // null: build
  const RaySet* rays = nullptr;
  bool any_hit = false;
  HitArrays hits;
  std::vector<uint8_t> blocked;
  std::unique_ptr<Accel> built = {};
  Scratch scratch = {};
};

std::unique_ptr<Accel> build(const World& world) {
  const std::atomic<bool> cancel{false};
  return Accel::build({world.mesh.view()}, {InstanceView{}}, 1, cancel);
}

}  // namespace

extern "C" __attribute__((noinline, visibility("default"))) void glint_counted_region(Work& work) {
  if (!work.rays) {
    work.built = build(work.world);
    return;
  }
  const Rays rays = work.rays->view(0, work.rays->size());
  if (work.any_hit) work.accel->occluded(rays, work.blocked.data(), work.scratch);
  else work.accel->closest(rays, work.hits.from(0), work.scratch);
}

int main(int argc, char** argv) {
  const std::string kind = argc == 2 ? argv[1] : "";
  const World world = load_world("bumpy:132x264");
  if (kind == "build") {
    Work work{world, nullptr, nullptr, false, HitArrays(1), {}, {}};
    glint_counted_region(work);
    std::printf("%zu %s\n", world.mesh.count(), __VERSION__);
    return 0;
  }
  const std::unique_ptr<Accel> accel = build(world);
  const FrameRays frame = make_rays(world, *accel, 256);
  const RaySet* const sets[] = {&frame.primary, &frame.shadow, &frame.shadow_from_light,
                                &frame.mirror, &frame.diffuse};
  const char* const names[] = {"primary", "shadow", "shadow_from_light", "mirror", "diffuse"};
  for (int k = 0; k < 5; ++k) {
    if (kind != names[k]) continue;
    const size_t count = sets[k]->size();
    Work work{world,
              accel.get(),
              sets[k],
              k == 1 || k == 2,
              HitArrays(count),
              std::vector<uint8_t>(count),
              {}};
    glint_counted_region(work);
    std::printf("%zu %s\n", count, __VERSION__);
    return 0;
  }
  std::fprintf(stderr, "ray_counts primary|shadow|shadow_from_light|mirror|diffuse|build\n");
  return 1;
}
