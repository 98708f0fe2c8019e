#include "bvh/build/turned_nodes.h"

#include <algorithm>
#include <cmath>

namespace glint {
namespace {

constexpr size_t kMost = 512;    // segments below a node that is turned: larger ones gain nothing
constexpr size_t kPart = 2048;   // segments, about, of what is turned at a time
constexpr size_t kParts = 512;   // of a tree, at most
constexpr double kWorth = 0.6;   // share of the boxes' surface from which on turning pays
constexpr double kUnit = 32767;  // length of the axes as they are stored
constexpr double kFarthest = 1e12;  // coordinates: farther ones may be infinite to rays then

/// A node's own axes: rows of what turns places.
struct Axes {
  Vec3d row[3];
  int16_t turn[3][4] = {};

  /// Along z, and any two across.
  explicit Axes(const Vec3d& z) {
    const Vec3d aside = std::fabs(z.x) < 0.5 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0),
                x = unit(cross(aside, z)), y = cross(z, x);
    for (int k = 0; k < 3; ++k) {
      const double column[3] = {x[k], y[k], z[k]};
      for (int axis = 0; axis < 3; ++axis) {
        turn[k][axis] = int16_t(std::lround(kUnit * column[axis]));
        row[axis][k] = turn[k][axis];
      }
    }
  }
};

/// A segment: its ends with their radii.
struct Segment {
  Vec3d at[2];
  double radius[2];
  Segment(const StrandArrays& s, size_t primitive) {
    const size_t first = s.starts[primitive];
    for (size_t j = 0; j < 2; ++j) {
      const float* p = s.vertices + 3 * (first + j);
      at[j] = Vec3d(p[0], p[1], p[2]);
      radius[j] = s.radii[first + j];
    }
  }
};

double surface(const BoxD& b) {
  const Vec3d e = b.hi - b.lo;
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

/// The nodes below one, and their segments.
class Part {
 public:
  Part(Tree& tree) : tree_(tree) {}
  /// Turns what is below; whether there is anything turned.
  bool turn(ChildRef root) {
    visit(root);
    return some_;
  }

 private:
  /// Adds the segments below.
  void visit(ChildRef child) {
    if (child & kLeaf) {
      const size_t first = child & kOrdinal, last = first + (child >> kCountShift & 7) + 1;
      for (size_t k = first; k < last; ++k)
        below_.emplace_back(tree_.strands, tree_.ids[k].primitive);
      return;
    }
    Node& node = tree_.nodes.nodes[child];
    size_t ends[kWidth + 1] = {below_.size()};
    for (int lane = 0; lane < kWidth; ++lane) {
      if (node.planes[0][lane] <= node.planes[1][lane]) visit(node.child[lane]);
      ends[lane + 1] = below_.size();
    }
    if (ends[kWidth] - ends[0] <= kMost) try_turn(node, ends);
  }
  /// Along the mean of the segments, as the longest of them points.
  Vec3d direction(size_t first, size_t last) const {
    Vec3d longest, sum;
    for (size_t k = first; k < last; ++k) {
      const Vec3d d = below_[k].at[1] - below_[k].at[0];
      if (dot(d, d) > dot(longest, longest)) longest = d;
    }
    for (size_t k = first; k < last; ++k) {
      const Vec3d d = below_[k].at[1] - below_[k].at[0];
      sum += dot(d, longest) < 0 ? -d : d;
    }
    return unit(sum);
  }
  void try_turn(Node& node, const size_t (&ends)[kWidth + 1]) {
    const Vec3d z = direction(ends[0], ends[kWidth]);
    if (!any(z)) return;
    const Axes axes(z);
    BoxD boxes[kWidth];
    double most = 0, after = 0;
    for (int lane = 0; lane < kWidth; ++lane)
      if (ends[lane] < ends[lane + 1]) most += kWorth * kUnit * kUnit * surface(box_of(node, lane));
    for (int lane = 0; lane < kWidth && after < most; ++lane) {
      if (ends[lane] == ends[lane + 1]) continue;
      for (size_t k = ends[lane]; k < ends[lane + 1]; ++k) add(boxes[lane], axes, below_[k]);
      after += surface(boxes[lane]);
    }
    if (!(after < most)) return;
    for (int lane = 0; lane < kWidth; ++lane)
      for (int axis = 0; axis < 3 && ends[lane] < ends[lane + 1]; ++axis) {
        node.planes[2 * axis][lane] = round_down(boxes[lane].lo[axis]);
        node.planes[2 * axis + 1][lane] = round_up(boxes[lane].hi[axis]);
      }
    std::copy_n(&axes.turn[0][0], 12, &node.turn[0][0]);
    node.turned = 1;
    some_ = true;
  }
  static BoxD box_of(const Node& node, int lane) {
    BoxD b;
    for (int axis = 0; axis < 3; ++axis) {
      b.lo[axis] = node.planes[2 * axis][lane];
      b.hi[axis] = node.planes[2 * axis + 1][lane];
    }
    return b;
  }
  /// With room for the rounding of double.
  static void add(BoxD& box, const Axes& axes, const Segment& s) {
    for (int axis = 0; axis < 3; ++axis) {
      const Vec3d& row = axes.row[axis];
      const double size = (1 + 0x1p-40) * length(row);
      for (size_t j = 0; j < 2; ++j) {
        const double at = dot(row, s.at[j]),
                     reach = size * s.radius[j] + 0x1p-46 * dot(abs(row), abs(s.at[j]));
        box.lo[axis] = std::min(box.lo[axis], at - reach);
        box.hi[axis] = std::max(box.hi[axis], at + reach);
      }
    }
  }

  Tree& tree_;
  std::vector<Segment> below_;
  bool some_ = false;
};

}  // namespace

bool turn_nodes(Tree& tree, ThreadPool& pool) {
  const Box& all = tree.nodes.box;
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::max(-double(all.lo[axis]), double(all.hi[axis])) < kFarthest)) return false;
  std::vector<ChildRef> parts{tree.nodes.root};
  const size_t wanted = std::min(kParts, tree.count / kPart);
  for (size_t k = 0; k < parts.size() && parts.size() < wanted; ++k) {
    if (parts[k] & kLeaf) continue;
    const Node& node = tree.nodes.nodes[parts[k]];
    for (int lane = 0; lane < kWidth; ++lane)
      if (node.planes[0][lane] <= node.planes[1][lane]) parts.push_back(node.child[lane]);
    parts[k] = kLeaf;  // its children stand for it
  }
  std::vector<uint8_t> some(parts.size(), 0);
  pool.run(parts.size(), [&](size_t k) {
    if (!(parts[k] & kLeaf)) some[k] = Part(tree).turn(parts[k]);
  });
  return std::count(some.begin(), some.end(), 1) > 0;
}

}  // namespace glint
