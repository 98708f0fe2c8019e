// One kind of work on one mesh, for counting instructions: ray_counts
// primary|camera|shadow|shadow_from_light|mirror|diffuse|build [MESH, as ray_sets.h has it, and how
// many rays a side]. camera: primary rays that the core makes, too. Everything to be counted
// happens inside glint_counted_region (valgrind --tool=callgrind
// --toggle-collect=glint_counted_region). Prints how many rays (build: triangles) that were, and
// the compiler; tests/bench/instructions.py runs it.
#include <cstdio>

#include <cstdlib>

#include "camera_blocks.h"

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
  CameraBlocks* camera = nullptr;
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
  for (size_t k = 0; work.camera && k < work.camera->size(); k += CameraBlocks::kMost)
    work.accel->closest(work.camera->make(k, CameraBlocks::kMost), work.camera->hits(),
                        work.scratch);
  if (work.camera) return;
  const Rays rays = work.rays->view(0, work.rays->size());
  if (work.any_hit) work.accel->occluded(rays, work.blocked.data(), work.scratch);
  else work.accel->closest(rays, work.hits.from(0), work.scratch);
}

int main(int argc, char** argv) {
  const std::string kind = argc > 1 ? argv[1] : "";
  const World world = load_world(argc > 2 ? argv[2] : "bumpy:132x264");
  const uint32_t size = argc > 3 ? uint32_t(std::atoi(argv[3])) : 256;
  if (kind == "build") {
    Work work{world, nullptr, nullptr, false, HitArrays(1), {}, {}};
    glint_counted_region(work);
    std::printf("%zu %s\n", world.mesh.count(), __VERSION__);
    return 0;
  }
  const std::unique_ptr<Accel> accel = build(world);
  const FrameRays frame = make_rays(world, *accel, size);
  const RaySet* const sets[] = {&frame.primary,           &frame.primary, &frame.shadow,
                                &frame.shadow_from_light, &frame.mirror,  &frame.diffuse};
  const char* const names[] = {"primary",           "camera", "shadow",
                               "shadow_from_light", "mirror", "diffuse"};
  CameraBlocks camera(world.view, size);
  for (int k = 0; k < 6; ++k) {
    if (kind != names[k]) continue;
    const size_t count = sets[k]->size();
    Work work{world,
              accel.get(),
              sets[k],
              k == 2 || k == 3,
              HitArrays(count),
              std::vector<uint8_t>(count),
              {},
              kind == "camera" ? &camera : nullptr};
    glint_counted_region(work);
    std::printf("%zu %s\n", count, __VERSION__);
    return 0;
  }
  std::fprintf(
      stderr,
      "ray_counts primary|camera|shadow|shadow_from_light|mirror|diffuse|build [MESH SIDE]\n");
  return 1;
}
