#include <algorithm>

#include "bvh/tlas.h"

namespace glint {
namespace {

bool inside(const Box& a, const Box& b) {
  for (int k = 0; k < 3; ++k)
    if (!(a.lo[k] >= b.lo[k] && a.hi[k] <= b.hi[k])) return false;
  return true;
}

Box child_box(const Node& n, int lane) {
  Box b;
  for (int k = 0; k < 3; ++k) {
    b.lo[k] = n.planes[2 * k][lane];
    b.hi[k] = n.planes[2 * k + 1][lane];
  }
  return b;
}

/// A triangle, or a part of it, in a leaf.
struct Held {
  PrimitiveId id;
  Box box;  // of the leaf
  Vec3d corner[3];
  bool operator<(const Held& b) const {
    return id.instance != b.id.instance ? id.instance < b.id.instance
                                        : id.primitive < b.id.primitive;
  }
};

Held held(const Tree& tree, ChildRef c, size_t place, const Box& box) {
  const size_t first = c & kOrdinal, count = (c >> kCountShift & 7) + 1;
  Held h{tree.ids[first + place], box, {}};
  for (size_t j = 0; j < 3; ++j)
    for (size_t axis = 0; axis < 3; ++axis)
      h.corner[j][int(axis)] = double(tree.floats[9 * first + (3 * j + axis) * count + place]);
  return h;
}

/// Whether points all over a triangle, 8 to a side, lie each in some leaf that holds it.
bool covered(const Held* first, const Held* last) {
  const Vec3d a = first->corner[0], b = first->corner[1], c = first->corner[2], u = b - a,
              v = c - a;
  const Vec3d low = min(a, min(b, c)), high = max(a, max(b, c));
  for (int i = 0; i <= 8; ++i)
    for (int j = 0; i + j <= 8; ++j) {
      const Vec3f p(max(low, min(high, a + (i / 8.0) * u + (j / 8.0) * v)));
      const F4 at{p.x, p.y, p.z, 0};
      if (std::none_of(first, last, [&](const Held& h) { return inside({at, at}, h.box); }))
        return false;
    }
  return true;
}

/// Walks a tree and counts how often everything is reached.
struct Walk {
  const Tree& tree;
  const std::vector<Box>& primitives;
  std::vector<uint8_t> nodes, leaves;
  std::vector<Held> parts;
  std::vector<std::pair<const Node*, int>> turned;  // the nodes on the way that are, and where
  std::string problem;

  Walk(const Tree& t, const std::vector<Box>& p)
      : tree(t), primitives(p), nodes(t.nodes.nodes.size), leaves(t.count) {}

  void leaf(ChildRef c, const Box& box) {
    const size_t first = c & kOrdinal, last = first + (c >> kCountShift & 7) + 1;
    if (last > tree.count) problem = "a leaf reads beyond the last primitive";
    for (size_t k = first; k < std::min(last, tree.count); ++k) {
      if (leaves[k]++) problem = "primitive " + std::to_string(k) + " is in two leaves";
      if (tree.parts) parts.push_back(held(tree, c, k - first, box));
      else if (!inside(primitives[k], box) || leaves_turned(k))
        problem = "primitive " + std::to_string(k) + " leaves its box";
    }
  }

  /// Whether a segment leaves a box of the turned nodes above it.
  bool leaves_turned(size_t k) const {
    if (turned.empty()) return false;
    const size_t first = tree.strands.starts[tree.ids[k].primitive];
    for (const auto& [node, lane] : turned)
      for (size_t axis = 0; axis < 3; ++axis) {
        const Vec3d row(node->turn[0][axis], node->turn[1][axis], node->turn[2][axis]);
        for (size_t end = first; end < first + 2; ++end) {
          const float* p = tree.strands.vertices + 3 * end;
          const double at = dot(row, Vec3d(p[0], p[1], p[2])),
                       reach = length(row) * double(tree.strands.radii[end]);
          if (!(at - reach >= double(node->planes[2 * axis][lane]) &&
                at + reach <= double(node->planes[2 * axis + 1][lane])))
            return true;
        }
      }
    return false;
  }

  void visit(ChildRef c, const Box& box, int depth) {
    if (!problem.empty()) return;
    if (c & kLeaf) return leaf(c, box);
    if (c >= nodes.size() || nodes[c]++ || depth >= kMaxDepth) {
      problem = "node " + std::to_string(c) + " is out of range, reached twice or too deep";
      return;
    }
    const Node& n = tree.nodes.nodes[c];
    for (int lane = 0; lane < kWidth; ++lane) {
      const Box b = child_box(n, lane);
      if (!(b.lo[0] <= b.hi[0])) continue;
      if (n.turned) {
        turned.emplace_back(&n, lane);
        visit(n.child[lane], box, depth + 1);
        turned.pop_back();
        continue;
      }
      if (!inside(b, box))
        problem = "a child of node " + std::to_string(c) + " leaves its parent's box";
      visit(n.child[lane], b, depth + 1);
    }
  }
};

/// A triangle that its leaves together do not hold, or that is in none.
std::string part_problem(std::vector<Held> parts, size_t primitives) {
  std::sort(parts.begin(), parts.end());
  size_t found = 0;
  for (const Held *first = parts.data(), *end = first + parts.size(), *last; first < end;
       first = last, ++found) {
    last = std::upper_bound(first, end, *first);
    if (!covered(first, last))
      return "triangle " + std::to_string(first->id.primitive) + " leaves its boxes";
  }
  return found == primitives ? "" : "a triangle is in no leaf";
}

Box polygon_box(const Tree& tree, const PolygonRecord& r) {
  const uint32_t axis = 3 - r.axis_u - r.axis_v;
  BoxD box;
  for (size_t c = r.first; c < r.first + r.count; ++c) {
    const float* p = &tree.corners[3 * c];
    Vec3d q(p[0], p[1], p[2]);
    const Vec3d n(r.n[0], r.n[1], r.n[2]);
    q[int(axis)] -= dot(n, q - Vec3d(r.p[0], r.p[1], r.p[2])) / n[int(axis)];
    box.add(q);
  }
  return {F4{float(box.lo.x), float(box.lo.y), float(box.lo.z), 0},
          F4{float(box.hi.x), float(box.hi.y), float(box.hi.z), 0}};
}

/// Calls body(ordinal, corners) for every triangle that a tree's leaves hold.
template <class Body>
void each_triangle(const Tree& tree, Body body) {
  const auto leaf = [&](ChildRef c) {
    const size_t first = c & kOrdinal, count = (c >> kCountShift & 7) + 1;
    for (size_t k = 0; k < count; ++k) body(first + k, held(tree, c, k, {}).corner);
  };
  if (tree.nodes.root & kLeaf) leaf(tree.nodes.root);
  for (size_t n = 0; n < tree.nodes.nodes.size; ++n)
    for (ChildRef c : tree.nodes.nodes[n].child)
      if (c & kLeaf) leaf(c);
}

Box sphere_box(const float* p) {
  Box b;
  for (int k = 0; k < 3; ++k) {
    b.lo[k] = round_down(double(p[k]) - double(p[3]));
    b.hi[k] = round_up(double(p[k]) + double(p[3]));
  }
  return b;
}

Box strand_box(const StrandArrays& s, size_t primitive) {
  const size_t k = s.starts[primitive];
  const float *p = s.vertices + 3 * k, *r = s.radii + k;
  const float first[4] = {p[0], p[1], p[2], r[0]}, second[4] = {p[3], p[4], p[5], r[1]};
  Box b = sphere_box(first);
  b.add(sphere_box(second));
  return b;
}

/// What the box of a placed object must hold: its triangles' corners, or those of the boxes of
/// other primitives.
std::vector<Vec3d> outer_points(const Tree& tree) {
  std::vector<Vec3d> points;
  if (tree.kind == kTriangleLeaf) {
    each_triangle(tree, [&points](size_t, const Vec3d(&corner)[3]) {
      points.insert(points.end(), corner, corner + 3);
    });
    return points;
  }
  for (const Box& b : primitive_boxes(tree))
    for (int k = 0; k < 8; ++k)
      points.push_back(
          {(k & 1 ? b.hi : b.lo)[0], (k & 2 ? b.hi : b.lo)[1], (k & 4 ? b.hi : b.lo)[2]});
  return points;
}

}  // namespace

std::vector<Box> primitive_boxes(const Tree& tree) {
  std::vector<Box> boxes(tree.count);
  const auto add = [&boxes](size_t k, const Vec3d(&corner)[3]) {
    for (const Vec3d& p : corner) boxes[k].add(F4{float(p.x), float(p.y), float(p.z), 0});
  };
  if (tree.kind == kTriangleLeaf) each_triangle(tree, add);
  for (size_t k = 0; k < tree.count; ++k) {
    if (tree.kind == kSphereLeaf) boxes[k] = sphere_box(&tree.floats[4 * k]);
    if (tree.kind == kStrandLeaf) boxes[k] = strand_box(tree.strands, tree.ids[k].primitive);
    if (tree.kind == kPolygonLeaf) boxes[k] = polygon_box(tree, tree.polygons[k]);
  }
  return boxes;
}

std::string tree_problem(const Tree& tree, const std::vector<Box>& primitives) {
  if (tree.count == 0) return "";
  Walk walk(tree, primitives);
  walk.visit(tree.nodes.root, tree.nodes.box, 0);
  if (!walk.problem.empty()) return walk.problem;
  if (std::count(walk.nodes.begin(), walk.nodes.end(), 0) > 0) return "a node is never reached";
  if (std::count(walk.leaves.begin(), walk.leaves.end(), 0) > 0)
    return "a primitive is never reached";
  return tree.parts ? part_problem(std::move(walk.parts), tree.primitives) : "";
}

std::string TopLevelBvh::validate() const {
  std::vector<const Tree*> trees;
  for (const BakedTree& baked : baked_) trees.push_back(baked.tree.get());
  for (const auto& tree : objects_) trees.push_back(tree.get());
  for (const Tree* tree : trees) {
    const std::string problem = tree_problem(*tree, primitive_boxes(*tree));
    if (!problem.empty()) return problem;
  }
  std::vector<std::vector<Vec3d>> points;
  for (const auto& tree : objects_) points.push_back(outer_points(*tree));
  std::vector<Box> boxes(placed_.tree->count);
  for (size_t k = 0; k < boxes.size(); ++k) {
    const InstanceRecord& r = placed_.records[k];
    if (k < placed_.built->count &&
        std::count(placed_.moved.begin(), placed_.moved.end(), r.instance))
      continue;  // is beside it
    BoxD b;
    for (const Vec3d& p : points[r.tree]) b.add(point(instances_[r.instance].world_from_object, p));
    boxes[k] = {F4{float(b.lo.x), float(b.lo.y), float(b.lo.z), 0},
                F4{float(b.hi.x), float(b.hi.y), float(b.hi.z), 0}};
  }
  return tree_problem(*placed_.tree, boxes);
}

}  // namespace glint
