#include "bvh/traverse/empty_tile_culling.h"

#include "bvh/bvh.h"

namespace glint {
namespace {

constexpr size_t kMostNodes = 256;  // to look at before giving up

/// The side from corner j to the next one: its normal, and by how much rounding may have turned it.
struct Side {
  Vec3d n;
  double turn;
  Side(const Vec3d (&o)[4], const Vec3d (&d)[4], int j) {
    const int k = (j + 1) % 4;
    const Vec3d apart = o[k] - o[j], across = any(apart) ? cross(apart, d[j]) : cross(d[j], d[k]);
    n = unit(across);
    turn = 0x1p-49 * (any(apart) ? std::max(max_abs(o[j]), max_abs(o[k])) : 1) / length(across);
  }
};

struct Span {
  Vec3d low, high;
};

/// Child k of a node. Of an absent one, low is beyond high.
Span span_of(const Node& n, int k) {
  Span s;
  for (int axis = 0; axis < 3; ++axis) {
    s.low[axis] = double(n.planes[2 * axis][k]);
    s.high[axis] = double(n.planes[2 * axis + 1][k]);
  }
  return s;
}

}  // namespace

TileFrustum::TileFrustum(const Vec3d (&origins)[4], const Vec3d (&directions)[4]) {
  std::copy_n(origins, 4, origins_);
  for (int j = 0; j < 4; ++j) {
    const Side side(origins, directions, j);
    n_[j] = side.n;
    turn_[j] = side.turn;
    const int across = (j + 2) % 4;
    const double inward = dot(n_[j], origins[across] - origins[j]) + dot(n_[j], directions[across]);
    if (!(inward > 0)) n_[j] = inward < 0 ? -n_[j] : Vec3d{};
  }
}

bool TileFrustum::misses(const Vec3d& low, const Vec3d& high, double margin, double reach) const {
  for (int j = 0; j < 4; ++j) {
    const Vec3d n = n_[j], a = low - origins_[j], b = high - origins_[j];
    const double farthest = std::max(n.x * a.x, n.x * b.x) + std::max(n.y * a.y, n.y * b.y) +
                            std::max(n.z * a.z, n.z * b.z);
    if (farthest < -(margin + turn_[j] * reach)) return true;
  }
  return false;
}

double TileFrustum::reach(const Vec3d& point) const {
  double most = 0;
  for (const Vec3d& o : origins_) most = std::max(most, length(o - point));
  return most;
}

bool surely_empty(const TreeView& tree, const TileFrustum& frustum) {
  const Vec3d center{tree.center[0], tree.center[1], tree.center[2]},
      ball{tree.ball, tree.ball, tree.ball};
  // What the kernels leave for rounding (Tile::margin), sixteen times over.
  const double reach = frustum.reach(center) + tree.radius,
               margin = 0x1p-16 * (max_abs(center) + 5 * tree.radius) + 0x1p-40 * reach;
  if (frustum.misses(center - ball, center + ball, margin, reach)) return true;
  const auto ends = [&tree](ChildRef c) { return c & kLeaf || tree.nodes[c].turned; };
  if (ends(tree.root)) return false;
  ChildRef waiting[kMostNodes + kWidth];
  size_t count = 0, seen = 0;
  for (waiting[count++] = tree.root; count > 0 && seen < kMostNodes; ++seen) {
    const Node& node = tree.nodes[waiting[--count]];
    for (int k = 0; k < kWidth; ++k) {
      const Span s = span_of(node, k);
      if (!(s.low.x <= s.high.x) || frustum.misses(s.low, s.high, margin, reach)) continue;
      if (ends(node.child[k])) return false;
      waiting[count++] = node.child[k];
    }
    if (count > kMostNodes) return false;
  }
  return count == 0;
}

}  // namespace glint
