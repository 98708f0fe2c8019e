// What the builder promises: sound trees for any input, counted losses, memory, cancel, and
// exceptions that reach the caller.
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <new>
#include <thread>
#if defined(_WIN32)
#include <malloc.h>
#endif

#include "bvh/build/builder.h"
#include "check.h"
#include "shapes.h"

namespace {

#if defined(_WIN32)
void* aligned(std::size_t size, std::size_t alignment) { return _aligned_malloc(size, alignment); }
void give(void* p) noexcept { _aligned_free(p); }
#else
void* aligned(std::size_t size, std::size_t alignment) {
  return std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}
void give(void* p) noexcept { std::free(p); }
#endif

std::atomic<long> allocations_left{0};  // the one that takes this from 1 to 0 fails

void* allocate(std::size_t size, std::size_t alignment) {
  long left = allocations_left.load();
  while (left > 0 && !allocations_left.compare_exchange_weak(left, left - 1)) continue;
  if (left == 1) throw std::bad_alloc();
  if (void* p = aligned(std::max<std::size_t>(size, 1), alignment)) return p;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) { return allocate(size, alignof(std::max_align_t)); }
void* operator new(std::size_t size, std::align_val_t alignment) {
  return allocate(size, std::size_t(alignment));
}
void operator delete(void* p) noexcept { give(p); }
void operator delete(void* p, std::size_t) noexcept { give(p); }
void operator delete(void* p, std::align_val_t) noexcept { give(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { give(p); }

using namespace glint;
using namespace glint::test;

TEST(build, nothing) {
  const auto none = build(std::vector<GeometryView>{}, {});
  CHECK(closest(*none, ray({0, 0, 5}, {0, 0, -1})).instance == Hit::kNone);
  CHECK(none->stats().nodes == 0 && none->stats().primitives == 0);
  const Mesh empty;
  CHECK(closest(*build(empty), ray({0, 0, 5}, {0, 0, -1})).instance == Hit::kNone);
  CHECK(build({empty.view()}, {InstanceView{}, InstanceView{}})->stats().primitives == 0);
}

TEST(build, one_triangle) {
  Mesh mesh;
  mesh.add(mesh.add({0, 0, 0}), mesh.add({1, 0, 0}), mesh.add({0, 1, 0}));
  const auto accel = build(mesh);
  const Hit h = closest(*accel, ray({0.25, 0.5, 3}, {0, 0, -2}));
  CHECK(h.instance == 0 && h.primitive == 0 && h.t == 1.5 && h.u == 0.25f && h.v == 0.5f);
  CHECK(accel->stats().primitives == 1 && accel->stats().dropped == 0);
}

/// Primitives from which on all threads of a build work on a part of it, and some more.
constexpr int kForThreads = 20000;

TEST(build, many) {
  Random random(1);
  for (size_t n : {2, 4, 5, 9, 33, 1000, 20000, 60000}) {
    const auto accel = build(soup(random, n, 1, 0.03));
    CHECK(accel->stats().primitives == n);
  }
}

TEST(build, a_million) {
  const Mesh mesh = bumpy_sphere(500, rounds(1000));
  const std::atomic<bool> cancel{false};
  for (BuildQuality quality : {BuildQuality::kFast, BuildQuality::kBalanced}) {
    const auto accel = Accel::build({mesh.view()}, {InstanceView{}}, 2, cancel, quality);
    CHECK(accel->stats().primitives == mesh.count() && accel->validate().empty());
  }
}

// A crowd and a few far away: the heuristic cuts between them, halves would not.
TEST(build, boxes_do_not_span_the_void) {
  Random random(6);
  std::vector<Ref> refs;
  for (uint32_t k = 0; k < 40000; ++k) {
    const Vec3d p = (k % 400 ? Vec3d{0, 0, 0} : Vec3d{100, 30, 0}) + random.in_box(1);
    BoxD box;
    box.add(p);
    box.add(p + Vec3d(0.01, 0.01, 0.01));
    refs.push_back(make_ref(box, k, 0));
  }
  ThreadPool pool(2);
  const std::atomic<bool> cancel{false};
  const NodeTree tree = build_nodes(refs.data(), refs.size(), {}, pool, cancel);
  for (size_t n = 0; n < tree.nodes.size; ++n)
    for (int lane = 0; lane < kWidth; ++lane)
      CHECK(!(tree.nodes[n].planes[0][lane] < 2 && tree.nodes[n].planes[1][lane] > 90));
}

TEST(build, all_coincident) {
  Mesh mesh;
  const uint32_t a = mesh.add({0, 0, 0}), b = mesh.add({1, 0, 0}), c = mesh.add({0, 1, 0});
  for (int k = 0; k < rounds(30000, kForThreads); ++k) mesh.add(a, b, c);
  const Hit h = closest(*build(mesh), ray({0.2, 0.2, 1}, {0, 0, -1}));
  CHECK(h.primitive == 0 && h.t == 1);
}

TEST(build, all_in_a_plane_or_on_a_line) {
  Random random(2);
  for (int flat : {1, 2}) {
    Mesh mesh = soup(random, 3000, 1, 0.05);
    for (size_t k = 0; k < mesh.vertices.size(); ++k)
      if (int(k % 3) < flat) mesh.vertices[k] = 0.25f;
    CHECK(build(mesh)->stats().primitives ==
          3000);  // those on a line stay: a mesh must not lose the edges that meet in them
  }
}

TEST(build, huge_and_tiny) {
  Random random(3);
  Mesh mesh;
  for (double size : {1e-30, 1e-12, 1.0, 1e12, 1e30, 3e38}) {
    const Mesh part = soup(random, 500, size, 0.1 * size);
    for (size_t k = 0; k < part.count(); ++k) {
      const uint32_t a = mesh.add(part.corner(k, 0)), b = mesh.add(part.corner(k, 1));
      mesh.add(a, b, mesh.add(part.corner(k, 2)));
    }
  }
  const AccelStats stats = build(mesh)->stats();
  CHECK(stats.primitives + stats.dropped == 3000 &&
        stats.dropped < 100);  // beyond the range of float there is nothing
  Mesh geometric;  // each half as large as the one before: the deepest tree that the heuristic can
                   // make
  for (int k = 0; k < 250; ++k) {
    const double s = std::ldexp(1.0, 120 - k);
    geometric.add(geometric.add({s, s, 0}), geometric.add({1.5 * s, s, 0}),
                  geometric.add({s, 1.5 * s, 0}));
  }
  CHECK(build(geometric)->stats().primitives == 250);
}

// The builder's grid: a crowd in one cell, which needs a grid of its own; boxes of all sizes; boxes
// that all are as large as the scene. Every ray from a triangle's middle must find something, and
// the tree must be the same for every pool.
TEST(build, crowds_and_giants) {
  Random random(6);
  Mesh crowd = soup(random, size_t(rounds(60000, kForThreads)), 1e-3, 1e-5), sizes,
       giants = soup(random, size_t(rounds(40000, kForThreads)), 1, 3);
  for (int k = 0; k < 100; ++k) {
    const Vec3d p = 100.0 * random.on_sphere();
    crowd.add(crowd.add(p), crowd.add(p + random.in_box(1)), crowd.add(p + random.in_box(1)));
  }
  for (int k = 0; k < rounds(50000, kForThreads); ++k) {
    const Vec3d p = random.in_box(1);
    const double size = std::ldexp(1.0, -int(random.below(16)));
    sizes.add(sizes.add(p), sizes.add(p + size * random.in_box(1)),
              sizes.add(p + size * random.in_box(1)));
  }
  for (const Mesh* mesh : {&crowd, &sizes, &giants}) {
    const auto one = build(*mesh, {}, 1), five = build(*mesh, {}, 5);
    CHECK(one->stats().primitives == mesh->count() && one->stats().nodes == five->stats().nodes);
    const size_t step = mesh->count() / size_t(rounds(int(mesh->count() / 97)));
    for (size_t k = 0; k < mesh->count(); k += step) {
      const Vec3d middle = 1 / 3.0 * (mesh->corner(k, 0) + mesh->corner(k, 1) + mesh->corner(k, 2));
      const Vec3d n = normalize(
          cross(mesh->corner(k, 1) - mesh->corner(k, 0), mesh->corner(k, 2) - mesh->corner(k, 0)));
      const Ray r = ray(middle + 1e-7 * n, -n, 0, 1);
      const Hit a = closest(*one, r), b = closest(*five, r);
      CHECK(a.instance == 0 && a.t == b.t && a.primitive == b.primitive);
    }
  }
}

TEST(build, bad_primitives_are_dropped_and_counted) {
  Random random(4);
  Mesh mesh = soup(random, 100, 1, 0.3);
  const float nan = std::numeric_limits<float>::quiet_NaN(),
              inf = std::numeric_limits<float>::infinity();
  mesh.vertices[9 * 10] = nan;
  mesh.vertices[9 * 20 + 4] = inf;
  mesh.vertices[9 * 30 + 8] = -inf;
  for (int k = 0; k < 3; ++k)
    mesh.vertices[size_t(9 * 40 + k)] =
        mesh.vertices[size_t(9 * 40 + 3 + k)];  // two corners are one
  mesh.triangles[3 * 50] = 100000;              // no such vertex
  const auto accel = build(mesh);
  CHECK(accel->stats().primitives == 95 && accel->stats().dropped == 5);
  InstanceView bad;
  bad.world_from_object.x.y = double(nan);
  CHECK(build({mesh.view()}, {bad})->stats().dropped == 100);
  CHECK(build({mesh.view()}, {bad, InstanceView{}})->stats().dropped == 105);
}

TEST(build, thousands_of_objects) {
  std::vector<Mesh> meshes;
  std::vector<GeometryView> views;
  std::vector<InstanceView> instances;
  Random random(5);
  for (uint32_t k = 0; k < 3000; ++k) {
    meshes.push_back(icosphere(0, 0.02, {}));
    InstanceView i;
    i.geometry = k;
    i.world_from_object = translation(random.uniform(0.1, 1) * random.on_sphere());
    instances.push_back(i);
  }
  for (const Mesh& m : meshes) views.push_back(m.view());
  const auto accel = build(views, instances);
  CHECK(accel->stats().primitives == 60000);
  int hits = 0;
  for (const InstanceView& i : instances)
    hits += closest(*accel, ray({0, 0, 0}, i.world_from_object.t)).t < 1;
  CHECK(hits == 3000);
}

TEST(build, bytes_a_triangle) {
  const Mesh mesh = bumpy_sphere(132, 264);
  CHECK(double(build(mesh)->stats().bytes) <= 70.0 * double(mesh.count()));
}

// Half of a crowd in each of ever smaller boxes: whatever halves space leaves half of it together,
// and the depth is limited.
TEST(build, crowds_within_crowds) {
  Random random(8);
  Mesh mesh;
  for (size_t count = 1 << 16, k = 0; count > 0; count /= 2, ++k) {
    const Mesh part =
        soup(random, count, std::ldexp(1.0, -4 * int(k)), std::ldexp(1.0, -4 * int(k) - 8));
    for (size_t t = 0; t < part.count(); ++t) {
      const uint32_t a = mesh.add(part.corner(t, 0)), b = mesh.add(part.corner(t, 1));
      mesh.add(a, b, mesh.add(part.corner(t, 2)));
    }
  }
  CHECK(build(mesh)->stats().primitives == mesh.count());
}

TEST(build, cancel) {
  const Mesh mesh = bumpy_sphere(132, 264);
  std::atomic<bool> cancel{true};
  for (BuildQuality quality : kQualities)
    CHECK(Accel::build({mesh.view()}, {InstanceView{}}, 2, cancel, quality) == nullptr);
  cancel = false;
  for (BuildQuality quality : kQualities)
    CHECK(Accel::build({mesh.view()}, {InstanceView{}}, 2, cancel, quality) != nullptr);
}

TEST(build, cancel_while_it_runs) {
  const Mesh mesh = bumpy_sphere(700, 1400);
  std::atomic<bool> cancel{false};
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(40));
    cancel = true;
  });
  CHECK(Accel::build({mesh.view()}, {InstanceView{}}, 2, cancel) == nullptr);
  other.join();
}

// Fails the first allocation of a build, then only the second, … : each must throw std::bad_alloc
// here, whatever its thread was. (Only a thread that cannot be started does not matter: then the
// tree must be right. Two are started, with one to four allocations each, as the C++ library
// likes.)
TEST(build, out_of_memory) {
  const Mesh mesh = bumpy_sphere(100, 90);
  const std::vector<GeometryView> views{mesh.view(), mesh.view()};
  std::vector<InstanceView> instances(3);
  instances[1].geometry = instances[2].geometry = 1;
  const std::atomic<bool> cancel{false};
  for (BuildQuality quality : kQualities) {
    int failed = 0, built = 0;
    for (long allowed = 1, left = 0; left == 0 && allowed < 100000; allowed += 1 + allowed / 8) {
      auto g = views;
      auto i = instances;
      std::unique_ptr<Accel> accel;
      allocations_left = allowed;
      try {
        accel = Accel::build(std::move(g), std::move(i), 3, cancel, quality);
      } catch (const std::bad_alloc&) {
        ++failed;
      }
      left = allocations_left.exchange(0);
      if (!accel) continue;
      ++built;
      CHECK(accel->validate().empty());
    }
    CHECK(failed > 20 && built <= 9);
  }
}
