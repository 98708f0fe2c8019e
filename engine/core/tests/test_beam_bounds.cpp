// What the vector finish of a beam's hits (finish_hits) takes for granted of those that floats are
// sure of: the bounds of weights that BeamTriangles tells.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "bvh/traverse/kernel_beam.h"
#include "check.h"
#include "shapes.h"

using namespace glint;
using namespace glint::test;

namespace {

constexpr int kTriangles = 8;
constexpr double kLeastArea = 0x1p-18 * 0.933;  // 2^-18.1

/// A tree of one leaf, in a ball of radius 1.
struct OneLeaf {
  float floats[9 * kTriangles + 16] = {};
  PrimitiveId ids[kTriangles] = {};
  TreeView tree{};
  OneLeaf() {
    tree.floats = floats;
    tree.ids = ids;
    tree.radius = tree.ball = 1;
    tree.root = kLeaf | uint32_t(kTriangles - 1) << kCountShift;
  }
  void set(int triangle, int corner, const double (&p)[3]) {
    for (int a = 0; a < 3; ++a)
      floats[a * kTriangles + corner * 3 * kTriangles + triangle] = float(p[a]);
  }
};

/// Rays of one beam, as columns.
struct BeamRays {
  double o[3][kBeam], d[3][kBeam], t_min[kBeam] = {}, t_max[kBeam];
  BeamRays(Vec3d eye, Vec3d middle, double step, Random& random) {
    const Vec3d x = step * random.on_sphere(), y = step * random.on_sphere();
    for (int k = 0; k < kBeam; ++k) {
      for (int a = 0; a < 3; ++a) o[a][k] = eye[a];
      aim(k, middle - eye + double(k % 16 - 8) * x + double(k / 16 - 8) * y);
      t_max[k] = HUGE_VAL;
    }
  }
  void aim(int k, Vec3d to) {
    for (int a = 0; a < 3; ++a) d[a][k] = to[a];
  }
  Rays view() const {
    return {{o[0], o[1], o[2]}, {d[0], d[1], d[2]}, t_min, t_max, kBeam, kCamera};
  }
  /// The most that a point is across, as any ray sees it.
  double across(const double (&p)[3], const int (&axes)[3]) const {
    double most = 0;
    for (int k = 0; k < kBeam; ++k)
      for (int a = 0; a < 2; ++a) {
        const double slope = d[axes[a]][k] / d[axes[2]][k], along = p[axes[2]] - o[axes[2]][k];
        most = std::max(most, std::fabs(p[axes[a]] - o[axes[a]][k] - slope * along));
      }
    return most;
  }
};

/// A small triangle round p, tilted or not, which the ray through p sees about as large as 2^-18 of
/// the square of what it is across.
void put_triangle(OneLeaf& leaf, int triangle, const BeamRays& rays, Vec3d p, const int (&axes)[3],
                  Random& random) {
  const double m = rays.across({p.x, p.y, p.z}, axes),
               area = std::pow(2, random.uniform(-19.5, -17)) * m * m,
               width = std::sqrt(area) * std::pow(10, random.uniform(-0.5, 0.5)),
               tilt = random.below(2) ? width * std::pow(10, random.uniform(-1, 1)) : 0,
               turn = random.uniform(0, 6.28), c = std::cos(turn), s = std::sin(turn);
  const double at[3][2] = {
      {-width / 2, -area / width / 3}, {width / 2, -area / width / 3}, {0, area / width * 2 / 3}};
  for (int j = 0; j < 3; ++j) {
    const double deeper = tilt * random.uniform(-1, 1), depth = p[axes[2]] - rays.o[axes[2]][0],
                 moved[2] = {c * at[j][0] - s * at[j][1], s * at[j][0] + c * at[j][1]};
    double q[3] = {p.x, p.y, p.z};
    q[axes[2]] += deeper;
    for (int a = 0; a < 2; ++a)
      q[axes[a]] += moved[a] + deeper * (p[axes[a]] - rays.o[axes[a]][0]) / depth;
    leaf.set(triangle, j, q);
  }
}

struct SureHits {
  int sure = 0, thin = 0, off = 0;
};

/// Hits that floats are sure of: all of them, those of triangles that look smaller than told, and
/// those whose weights single rays would find by the triangle's edges.
SureHits sure_hits(Random& random) {
  SureHits found;
  const Vec3d eye = random.uniform(1.2, 3.9) * random.on_sphere();
  BeamRays rays(eye, random.in_box(0.3), std::pow(10, random.uniform(-4, -1)), random);
  OneLeaf leaf;
  Vec3d points[kTriangles];
  for (Vec3d& p : points) rays.aim(int(random.below(kBeam)), (p = random.in_box(0.5)) - eye);
  const int (&axes)[3] = kOrders[axis_class_of({rays.d[0][0], rays.d[1][0], rays.d[2][0]})].axes;
  for (int k = 0; k < kTriangles; ++k) put_triangle(leaf, k, rays, points[k], axes, random);
  Beam beam;
  if (!set_from_apex(beam, leaf.tree, rays.view(), 0)) return found;
  CHECK(beam.close >= 0x1p-21 * leaf.tree.radius);
  Answers answers{};
  BeamWalk<false> walk{leaf.tree, beam, answers};
  walk.set_end();
  walk.leaf(leaf.tree.root);
  for (int r = 0; r < kBeam; ++r) {
    if (beam.pending[r] == kNothing || beam.leaf_at[r] & kDecided) continue;
    const int place = int(beam.leaf_at[r]);
    const Triangles triangles(leaf.tree, leaf.tree.root);
    double m = 0;
    for (int j = 0; j < 3; ++j) {
      double corner[3];
      for (int a = 0; a < 3; ++a) corner[a] = double(triangles.at(j, a)[place]);
      m = std::max(m, rays.across(corner, axes));
    }
    const BeamRay ray(beam.source, r);
    if (&ray.order != beam.order) continue;  // such are not finished in vectors
    Exact<double> e = ray.see(triangles, place);
    const double area =
        (e.x[1] - e.x[0]) * (e.y[2] - e.y[0]) - (e.x[2] - e.x[0]) * (e.y[1] - e.y[0]);
    e.weigh();
    ++found.sure;
    found.thin += !(std::fabs(area) >= kLeastArea * m * m) || !(m <= 35 * leaf.tree.radius);
    found.off += !(std::fabs(e.off_x) <= beam.close && std::fabs(e.off_y) <= beam.close);
  }
  return found;
}

}  // namespace

TEST(beams, weights_of_sure_hits_need_no_check) {
  Random random(16);
  SureHits all;
  for (int k = 0; k < rounds(20000); ++k) {
    const SureHits found = sure_hits(random);
    all.sure += found.sure;
    all.thin += found.thin;
    all.off += found.off;
  }
  CHECK(all.sure > rounds(10000));
  CHECK(all.thin == 0);
  CHECK(all.off == 0);
}
