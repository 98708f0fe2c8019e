#include "bvh/outline.h"

namespace glint {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();

/// Bounds the values over the points of a tree of term(0, x) + term(1, y) + term(2, z), convex
/// functions: no point of a box has more than one of its corners. Looks first where most can be,
/// and nowhere for less than `slack`.
template <class Term>
class Farthest {
 public:
  Farthest(const Tree& tree, Term term, float slack, int nodes)
      : tree_(tree), term_(term), slack_(slack), nodes_left_(nodes) {}
  /// `limit`: what is known to bound them.
  float find(float limit) {
    visit(tree_.nodes.root, std::min(limit, of_box(tree_.nodes.box)));
    return std::min(limit, best_ + slack_);
  }

 private:
  /// `most`: the value of the child's box.
  void visit(ChildRef child, float most) {
    if (child & kLeaf || nodes_left_-- <= 0 || tree_.nodes.nodes[child].turned) {
      best_ = std::max(best_, child & kLeaf ? std::min(most, of_leaf(child)) : most);
      return;
    }
    const Node& node = tree_.nodes.nodes[child];
    float value[kWidth];
    of_children(node, value);
    for (;;) {
      const size_t k = size_t(std::max_element(value, value + kWidth) - value);
      const float next = std::min(value[k], most);
      if (!(next > best_ + slack_)) return;
      value[k] = -kInfinite;
      visit(node.child[k], next);
    }
  }
  float of_box(const Box& b) const {
    float sum = 0;
    for (int axis = 0; axis < 3; ++axis)
      sum += std::max(term_(axis, b.lo[axis]), term_(axis, b.hi[axis]));
    return sum;
  }
  void of_children(const Node& n, float (&value)[kWidth]) const {
    std::fill_n(value, kWidth, 0.0f);
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < kWidth; ++k)
        value[k] +=
            std::max(term_(axis, n.planes[2 * axis][k]), term_(axis, n.planes[2 * axis + 1][k]));
    for (int k = 0; k < kWidth; ++k)
      if (!(n.planes[0][k] <= n.planes[1][k])) value[k] = -kInfinite;  // absent
  }
  /// What the corners of a leaf's triangles have; of other primitives nothing is known but their
  /// box.
  float of_leaf(ChildRef leaf) const {
    if (tree_.kind != kTriangleLeaf) return kInfinite;
    const size_t count = (leaf >> kCountShift & 7) + 1;
    const float* corner = tree_.floats.data.get() + 9 * size_t(leaf & kOrdinal);
    float most = -kInfinite;
    for (size_t j = 0; j < 3; ++j, corner += 3 * count)
      for (size_t k = 0; k < count; ++k)
        most = std::max(most, term_(0, corner[k]) + term_(1, corner[count + k]) +
                                  term_(2, corner[2 * count + k]));
    return most;
  }

  const Tree& tree_;
  const Term term_;
  const float slack_;
  int nodes_left_;
  float best_ = -kInfinite;
};

Vec3d at(F4 p) { return {double(p[0]), double(p[1]), double(p[2])}; }
Vec3d middle(const Box& b) { return 0.5 * at(b.lo) + 0.5 * at(b.hi); }

/// Bounds dot(n, p) over a tree's points p.
double support(const Tree& tree, Vec3d n) {
  const double size = max_abs(n);
  if (!(size > 0)) return 0;
  n = {n.x / size, n.y / size, n.z / size};
  const float unit[3] = {float(n.x), float(n.y), float(n.z)};
  const Box& box = tree.nodes.box;
  const double limit = dot(n, middle(box)) + length(n) * tree.ball,
               extent = dot(abs(n), at(box.hi) - at(box.lo));
  return size * double(Farthest(
                           tree, [&unit](int axis, float p) { return unit[axis] * p; },
                           float(extent) / 64, 16)
                           .find(float(limit)));
}

/// Round the eight corners of a box.
BoxD corner_box(const Box& box, const Affine& m) {
  BoxD out;
  for (int k = 0; k < 8; ++k) {
    const Vec3d p(double((k & 1 ? box.hi : box.lo)[0]), double((k & 2 ? box.hi : box.lo)[1]),
                  double((k & 4 ? box.hi : box.lo)[2]));
    out.add(point(m, p));
  }
  return out;
}

}  // namespace

BoxD world_box(const Tree& tree, const Affine& m) {
  const Box& box = tree.nodes.box;
  BoxD out = corner_box(box, m);
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d n{m.x[axis], m.y[axis], m.z[axis]};
    out.lo[axis] =
        std::max(out.lo[axis], m.t[axis] - support(tree, -n));  // the first where the second is NaN
    out.hi[axis] = std::min(out.hi[axis], m.t[axis] + support(tree, n));
  }
  // Rays are rounded to float in object space, and so is the support: leave room for 16 ulps of the
  // largest coordinate there.
  const Vec3d object = max(abs(at(box.lo)), abs(at(box.hi)));
  const Vec3d margin = 0x1p-20 * (abs(m.x) * object.x + abs(m.y) * object.y + abs(m.z) * object.z);
  out.lo = out.lo - margin;
  out.hi = out.hi + margin;
  return out;
}

double ball_radius(const Tree& tree) {
  const Vec3d c = middle(tree.nodes.box);
  const float center[3] = {float(c.x), float(c.y), float(c.z)};
  const double extent = max_abs(at(tree.nodes.box.hi) - at(tree.nodes.box.lo));
  const double unit = extent > 0 ? std::ldexp(1.0, std::ilogb(extent))
                                 : 1;  // squares of others do not fit into floats
  const auto square = [&center, unit](int axis, float p) {
    const float far = float(double(p - center[axis]) / unit);
    return far * far;
  };
  return unit * std::sqrt(double(Farthest(tree, square, 0, 1000).find(kInfinite)));
}

}  // namespace glint
