// Rays a second of the accelerator by kind of ray: accel_bench [rounds [mesh [kind]]]. With a mesh
// (0 ...) and a kind (0 primary, 1 shadow, 2 mirror, 3 diffuse) only that one: to count its
// instructions with callgrind or perf, subtract a run with 0 rounds.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>

#include "../tests/shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

constexpr size_t kBatch = 8192;  // as the renderer hands them over
constexpr int kSide = 1024;      // pixels; in blocks of 8 by 8

/// Time of this process on its processors: other work on the machine does not count.
double now() { return double(std::clock()) / CLOCKS_PER_SEC; }

struct Batch {
  std::vector<double> columns[8];
  size_t count() const { return columns[0].size(); }
  void add(Vec3d o, Vec3d d, double t_min, double t_max) {
    const double values[8] = {o.x, o.y, o.z, d.x, d.y, d.z, t_min, t_max};
    for (int k = 0; k < 8; ++k) columns[k].push_back(values[k]);
  }
  Vec3d origin(size_t k) const { return {columns[0][k], columns[1][k], columns[2][k]}; }
  Vec3d direction(size_t k) const { return {columns[3][k], columns[4][k], columns[5][k]}; }
  Rays rays(size_t first, size_t n) const {
    auto at = [&](int k) { return columns[k].data() + first; };
    return {{at(0), at(1), at(2)},      {at(3), at(4), at(5)}, at(6), at(7), n,
            kCamera | kMirror | kShadow};
  }
  template <class Trace>
  void each(Trace trace) const {
    for (size_t k = 0; k < count(); k += kBatch) trace(k, rays(k, std::min(kBatch, count() - k)));
  }
};

struct Answer {
  std::vector<double> t;
  std::vector<uint32_t> instance, primitive;
  std::vector<float> u, v;
  std::vector<uint8_t> blocked;
  explicit Answer(size_t n) : t(n), instance(n), primitive(n), u(n), v(n), blocked(n) {}
};

void closest(const Accel& accel, const Batch& batch, Answer& a) {
  Scratch s;
  batch.each([&](size_t k, const Rays& r) {
    accel.closest(r, {&a.t[k], &a.instance[k], &a.primitive[k], &a.u[k], &a.v[k]}, s);
  });
}
void occluded(const Accel& accel, const Batch& batch, Answer& a) {
  Scratch scratch;
  batch.each([&](size_t k, const Rays& r) { accel.occluded(r, &a.blocked[k], scratch); });
}

struct Scene {
  const char* name;
  Mesh mesh;
  std::vector<InstanceView> instances{InstanceView{}};
  Vec3d eye{0.3, -3, 0.5}, light{2, -2, 3};
};

Batch camera_rays(const Scene& s) {
  Batch batch;
  const Vec3d forward = normalize(-s.eye), right = normalize(cross(forward, Vec3d{0, 0, 1})),
              up = cross(right, forward);
  for (int b = 0; b < kSide * kSide / 64; ++b)
    for (int k = 0; k < 64; ++k) {
      const int i = b % (kSide / 8) * 8 + k % 8, j = b / (kSide / 8) * 8 + k / 8;
      batch.add(s.eye,
                forward + (0.8 * ((i + 0.5) / kSide - 0.5)) * right +
                    (0.8 * ((j + 0.5) / kSide - 0.5)) * up,
                0, HUGE_VAL);
    }
  return batch;
}

/// Rays from the hits of `primary`: to the light, mirrored, and anywhere over the surface.
void secondary_rays(const Scene& s, const Batch& primary, const Answer& hits, Batch (&out)[3]) {
  Random random(1);
  for (size_t k = 0; k < primary.count(); ++k) {
    if (hits.instance[k] == Hit::kNone) continue;
    const Affine& m = s.instances[hits.instance[k]].world_from_object;
    const Vec3d a = point(m, s.mesh.corner(hits.primitive[k], 0)),
                b = point(m, s.mesh.corner(hits.primitive[k], 1)),
                c = point(m, s.mesh.corner(hits.primitive[k], 2)), d = primary.direction(k);
    Vec3d n = normalize(cross(b - a, c - a));
    if (dot(n, d) > 0) n = -n;
    const double u = double(hits.u[k]), v = double(hits.v[k]);
    const Vec3d p = (1 - u - v) * a + u * b + v * c + 2e-6 * n;
    if (dot(s.light - p, n) > 0) out[0].add(p, s.light - p, 0, 1);
    out[1].add(p, d - (2 * dot(d, n)) * n, 0, HUGE_VAL);
    out[2].add(p, n + 0.999 * random.on_sphere(), 0, HUGE_VAL);
  }
}

Scene instances_scene() {
  Scene s{"10000 instances", icosphere(3, 0.02, {})};
  Random random(3);
  s.instances.clear();
  for (int k = 0; k < 10000; ++k) {
    InstanceView i;
    i.world_from_object = random_affine(random, 1);
    s.instances.push_back(i);
  }
  return s;
}

std::vector<std::function<Scene()>> scenes() {
  Random random(2);
  return {[] { return Scene{"bumpy 5k", bumpy_sphere(36, 70)}; },
          [] { return Scene{"bumpy 70k", bumpy_sphere(132, 264)}; },
          [] { return Scene{"bumpy 1M", bumpy_sphere(500, 1000)}; },
          [] { return Scene{"boxes 19k", box_grid(40, 0.8, {})}; },
          [random]() mutable { return Scene{"soup 50k", soup(random, 50000, 1, 0.03)}; },
          instances_scene};
}

void measure(const Scene& s, int rounds, int only) {
  const std::atomic<bool> cancel{false};
  const auto accel = Accel::build({s.mesh.view()}, s.instances, 2, cancel);
  const Batch primary = camera_rays(s);
  Answer hits(primary.count());
  closest(*accel, primary, hits);
  Batch others[3];
  secondary_rays(s, primary, hits, others);
  const Batch* all[4] = {&primary, &others[0], &others[1], &others[2]};
  std::printf("%-16s", s.name);
  for (int kind = 0; kind < 4; ++kind) {
    if (only >= 0 && kind != only) continue;
    double best = HUGE_VAL;
    for (int k = 0; k < rounds; ++k) {
      const double start = now();
      kind == 1 ? occluded(*accel, *all[kind], hits) : closest(*accel, *all[kind], hits);
      best = std::min(best, now() - start);
    }
    std::printf(" %9.2f", 1e-6 * double(all[kind]->count()) / best);
    std::fflush(stdout);
  }
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 5;
  const int mesh = argc > 2 ? std::atoi(argv[2]) : -1, kind = argc > 3 ? std::atoi(argv[3]) : -1;
  std::printf("%-16s %9s %9s %9s %9s   (million rays a second)\n", "", "primary", "shadow",
              "mirror", "diffuse");
  const auto list = scenes();
  for (int k = 0; k < int(list.size()); ++k)
    if (mesh < 0 || k == mesh) measure(list[size_t(k)](), rounds, kind);
}
