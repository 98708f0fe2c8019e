// Rays a second and build time of the accelerator: accel_bench [threads of the build] [million triangles].
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "../tests/shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

/// Time of this process on its processors: other work on the machine does not count.
double now() { return double(std::clock()) / CLOCKS_PER_SEC; }

/// Median of five runs, in seconds.
template <class Body>
double seconds(Body body) {
  double t[5];
  for (double& x : t) {
    const double start = now();
    body();
    x = now() - start;
  }
  std::sort(t, t + 5);
  return t[2];
}

std::vector<Ray> camera_rays(int n) {
  std::vector<Ray> rays;
  const Vec3d eye{0, -3, 0.5};
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) rays.push_back(ray(eye, {0.8 * ((i + 0.5) / n - 0.5), 1, 0.8 * ((j + 0.5) / n - 0.5) - 0.16}));
  return rays;
}

void report(const char* name, size_t rays, double s) { std::printf("%-28s %7.2f Mrays/s\n", name, 1e-6 * double(rays) / s); }

void rays_a_second(const Mesh& mesh, const Accel& accel) {
  const std::vector<Ray> rays = camera_rays(512);
  std::vector<Hit> hits(rays.size());
  report("primary", rays.size(), seconds([&] { accel.closest(rays.data(), hits.data(), rays.size()); }));
  std::vector<Ray> shadow, bounce;
  Random random(1);
  for (size_t k = 0; k < rays.size(); ++k) {
    if (hits[k].instance == Hit::kNone) continue;
    const Vec3d a = mesh.corner(hits[k].primitive, 0), b = mesh.corner(hits[k].primitive, 1), c = mesh.corner(hits[k].primitive, 2);
    Vec3d n = normalize(cross(b - a, c - a));
    if (dot(n, rays[k].d) > 0) n = -n;
    const Vec3d p = rays[k].o + hits[k].t * rays[k].d + 1e-5 * n;
    shadow.push_back(ray(p, Vec3d{2, -2, 3} - p, 0, 1));
    bounce.push_back(ray(p, n + 0.999 * random.on_sphere()));
  }
  std::vector<uint8_t> blocked(shadow.size());
  report("shadow (any hit)", shadow.size(), seconds([&] { accel.occluded(shadow.data(), blocked.data(), shadow.size()); }));
  report("diffuse (closest)", bounce.size(), seconds([&] { accel.closest(bounce.data(), hits.data(), bounce.size()); }));
}

}  // namespace

int main(int argc, char** argv) {
  const int threads = argc > 1 ? std::atoi(argv[1]) : 2;
  const double millions = argc > 2 ? std::atof(argv[2]) : 1;
  const Mesh small = bumpy_sphere(132, 264);
  const auto accel = build(small, {}, threads);
  std::printf("%zu triangles, %.1f bytes a triangle\n", small.count(), double(accel->stats().bytes) / double(small.count()));
  rays_a_second(small, *accel);
  const int rows = int(std::sqrt(millions * 250e3));
  const Mesh large = bumpy_sphere(rows, 2 * rows);
  double best = 1e9, work = 1e9;
  std::unique_ptr<Accel> big;
  for (int k = 0; k < 5; ++k) {
    const std::atomic<bool> cancel{false};
    InstanceView i;
    const double start = now();
    big = Accel::build({large.view()}, {i}, threads, cancel);
    best = std::min(best, big->stats().seconds), work = std::min(work, now() - start);
  }
  const AccelStats stats = big->stats();
  std::printf("%zu triangles: %.3f s on %d threads (best of 5; %.3f s of processor time)\n", large.count(), best, threads, work);
  std::printf("%.1f bytes a triangle, %zu nodes\n", double(stats.bytes) / double(large.count()), stats.nodes);
  rays_a_second(large, *big);
}
