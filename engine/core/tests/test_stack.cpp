// Rays on a thread with as small a stack as some systems give one (musl: 128 KB).
#include <pthread.h>

#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

constexpr size_t kStackBytes = 128 * 1024;

/// Rays through instances of a ball: from one point, and from everywhere.
struct Work {
  std::unique_ptr<Accel> accel;
  std::vector<Ray> rays;
  std::vector<Hit> hits;
  std::vector<uint8_t> blocked;

  void trace() {
    Scratch scratch;
    hits.resize(rays.size());
    blocked.resize(rays.size());
    accel->closest(rays.data(), hits.data(), rays.size(), scratch);
    accel->occluded(rays.data(), blocked.data(), rays.size(), scratch);
  }
};

void* trace(void* work) {
  static_cast<Work*>(work)->trace();
  return nullptr;
}

void trace_on_small_stack(Work& work) {
  pthread_attr_t attributes;
  CHECK(pthread_attr_init(&attributes) == 0 &&
        pthread_attr_setstacksize(&attributes, kStackBytes) == 0);
  pthread_t thread;
  CHECK(pthread_create(&thread, &attributes, trace, &work) == 0 &&
        pthread_join(thread, nullptr) == 0);
  pthread_attr_destroy(&attributes);
}

}  // namespace

TEST(stack, rays_through_instances_need_little) {
  Random random(11);
  const Mesh ball = icosphere(3, 0.4, {});
  std::vector<InstanceView> instances;
  for (int k = 0; k < 200; ++k)
    instances.push_back({0, kCamera | kMirror | kShadow, translation(random.in_box(2))});
  Work work{build({ball.view()}, instances), {}, {}, {}};
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x)
      work.rays.push_back(ray({0, 0, 8}, {0.006 * (x - 32), 0.006 * (y - 32), -1}));
  for (int k = 0; k < 4096; ++k) work.rays.push_back(ray(random.in_box(2), random.on_sphere()));
  trace_on_small_stack(work);
  size_t hits = 0;
  for (size_t k = 0; k < work.rays.size(); ++k) {
    const Hit h = closest(*work.accel, work.rays[k]);
    CHECK(h.instance == work.hits[k].instance && h.t == work.hits[k].t &&
          (h.instance != Hit::kNone) == work.blocked[k]);
    hits += h.instance != Hit::kNone;
  }
  CHECK(hits > work.rays.size() / 4);
}
