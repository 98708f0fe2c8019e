#include "bvh/build/builder_spatial.h"

#include <algorithm>
#include <new>

#include "bvh/build/builder_nodes.h"
#include "bvh/build/builder_split.h"

namespace glint {
namespace {

constexpr double kMostCuts = 0.5;  // of the refs: how many more
constexpr double kOverlap = 0.2;   // of a part's surface, and
constexpr double kSceneOverlap =
    1e-5;  // of the scene's: children that share less are not worth a cut
constexpr int kSpaceBins = 16;
constexpr size_t kTask = 4096;  // refs: below, a part is the work of one thread

/// Refs on their way into nodes. `spare`: how many more they may become.
struct Part {
  std::vector<Ref> refs;
  Box box;
  double spare = 0;
};

Box box_of(const Ref& r) { return {low(r), high(r)}; }

/// The half of a ref's box below or above a plane that its triangle reaches, two ulps larger than
/// computed.
Ref half_of(const Ref& r, const Vec3d (&corner)[3], int axis, double at, bool above) {
  BoxD box;
  const auto beyond = [&](Vec3d p) { return above ? p[axis] - at : at - p[axis]; };
  for (int j = 0; j < 3; ++j) {
    const Vec3d a = corner[j], b = corner[j == 2 ? 0 : j + 1];
    const double da = beyond(a), db = beyond(b);
    if (da >= 0) box.add(a);
    if ((da > 0 && db < 0) || (da < 0 && db > 0)) box.add(a + (da / (da - db)) * (b - a));
  }
  Ref half = r;
  for (int k = 0; k < 3; ++k) {
    const double margin = 0x1p-22 * std::max(std::fabs(box.lo[k]), std::fabs(box.hi[k])) +
                          double(std::numeric_limits<float>::denorm_min());
    half.lo[k] = std::max(r.lo[k], float(box.lo[k] - margin));
    half.hi[k] = std::min(r.hi[k], float(box.hi[k] + margin));
  }
  if (above) half.lo[axis] = std::max(r.lo[axis], float(at));
  else half.hi[axis] = std::min(r.hi[axis], float(at));
  return half;
}

/// Planes between bins of equal width along one axis of a box.
struct Planes {
  float origin, width;
  int axis;
  Planes(const Box& box, int k)
      : origin(box.lo[k]), width((box.hi[k] - box.lo[k]) / kSpaceBins), axis(k) {}
  bool sound() const { return width > 1e-35f && width <= std::numeric_limits<float>::max(); }
  float at(int bin) const { return origin + float(bin) * width; }
  /// The bin that holds a coordinate: at(bin) <= x < at(bin + 1), as far as there are bins.
  int bin(float x) const {
    int b = std::clamp(int((x - origin) / width), 0, kSpaceBins - 1);
    while (b > 0 && x < at(b)) --b;
    while (b + 1 < kSpaceBins && x >= at(b + 1)) ++b;
    return b;
  }
};

/// A plane through a part, and what lies on its sides: refs across it count on both.
struct SpaceSplit {
  float cost = std::numeric_limits<float>::infinity(), at = 0;
  int axis = -1;
  size_t left = 0, right = 0;
  Box left_box, right_box;
};

struct SpaceBins {
  Box box[kSpaceBins];
  size_t first[kSpaceBins] = {}, last[kSpaceBins] = {};  // refs that begin and end in a bin

  void add(Ref r, const Planes& planes, const CornersOf& corners) {
    const int from = planes.bin(r.lo[planes.axis]), to = planes.bin(r.hi[planes.axis]);
    ++first[from];
    ++last[to];
    if (from < to) {
      Vec3d corner[3];
      corners(r, corner);
      for (int b = from; b < to; ++b) {
        const double at = double(planes.at(b + 1));
        box[b].add(box_of(half_of(r, corner, planes.axis, at, false)));
        r = half_of(r, corner, planes.axis, at, true);
      }
    }
    box[to].add(box_of(r));
  }
  void best(const Planes& planes, SpaceSplit& best) const {
    Box right_box[kSpaceBins], box_here;
    size_t right[kSpaceBins], count = 0;
    for (int b = kSpaceBins - 1; b > 0; --b) {
      box_here.add(box[b]);
      right_box[b] = box_here;
      right[b] = count += last[b];
    }
    box_here = {};
    count = 0;
    for (int b = 1; b < kSpaceBins; ++b) {
      box_here.add(box[b - 1]);
      count += first[b - 1];
      if (count == 0 || right[b] == 0) continue;
      const float cost =
          float(half_area(box_here) * double(count) + half_area(right_box[b]) * double(right[b]));
      if (cost < best.cost)
        best = {cost, planes.at(b), planes.axis, count, right[b], box_here, right_box[b]};
    }
  }
};

/// Makes nodes over parts; those of `sah_threshold` refs or less are handed to `later` instead, if
/// there is one.
class Maker {
 public:
  struct Task {
    size_t node;
    int lane, depth;
    Part part;
  };
  std::vector<Node> nodes;
  std::vector<Ref> leaves;
  std::vector<Task> later;

  Maker(const CornersOf& corners, const BuildOptions& options, double scene, size_t sah_threshold,
        const std::atomic<bool>& cancel)
      : corners_(corners),
        options_(options),
        scene_(scene),
        sah_threshold_(sah_threshold),
        cancel_(cancel) {}

  ChildRef make(Part& part, int depth) {
    if (cancel_.load(std::memory_order_relaxed)) throw Cancelled{};
    if (part.refs.size() <= options_.max_leaf) return leaf(part);
    std::vector<Part> children;
    children.reserve(kWidth);
    children.push_back(std::move(part));
    open(children, depth);
    const size_t index = nodes.size();
    nodes.emplace_back();
    for (int k = 0; k < kWidth; ++k) {
      const bool there = k < int(children.size());
      set_child(nodes[index], k, there ? &children[size_t(k)].box : nullptr);
      if (!there) continue;
      const ChildRef child = below(children[size_t(k)], index, k, depth + 1);
      nodes[index].child[k] = child;
    }
    return ChildRef(index);
  }

 private:
  ChildRef below(Part& part, size_t node, int lane, int depth) {
    if (part.refs.size() > sah_threshold_ || part.refs.size() <= options_.max_leaf)
      return make(part, depth);
    later.push_back({node, lane, depth, std::move(part)});
    return 0;
  }
  /// Parts of one triangle that meet again are one.
  ChildRef leaf(const Part& part) {
    const size_t first = leaves.size();
    for (const Ref& r : part.refs) {
      const auto same = [&](const Ref& q) {
        return q.primitive == r.primitive && q.source == r.source;
      };
      if (std::none_of(leaves.begin() + ptrdiff_t(first), leaves.end(), same)) leaves.push_back(r);
    }
    return leaf_ref(first, leaves.size() - first);
  }

  void open(std::vector<Part>& children, int depth) {
    std::vector<bool> whole(kWidth, false);  // no split is worth it
    for (int k; children.size() < kWidth && (k = largest(children, whole)) >= 0;) {
      Part a, b;
      if (!split(children[size_t(k)], depth, a, b)) whole[size_t(k)] = true;
      else {
        children[size_t(k)] = std::move(a);
        children.push_back(std::move(b));
      }
    }
  }
  int largest(const std::vector<Part>& children, const std::vector<bool>& whole) const {
    int best = -1;
    for (int k = 0; k < int(children.size()); ++k) {
      const Part& p = children[size_t(k)];
      if (whole[size_t(k)] || p.refs.size() <= options_.min_leaf) continue;
      if (best < 0 || half_area(p.box) > half_area(children[size_t(best)].box)) best = k;
    }
    return best;
  }

  bool split(Part& part, int depth, Part& a, Part& b) {
    const BinMap map(centroid_box(part.refs.data(), part.refs.data() + part.refs.size()),
                     part.refs.size());
    Split objects;
    if (depth < kMedianDepth) {
      bins_.fill<Single>(part.refs.data(), part.refs.data() + part.refs.size(), map);
      objects = best_split(bins_, map, Areas(part.box));
    }
    const SpaceSplit space = depth < kMedianDepth ? best_space(part, objects) : SpaceSplit{};
    if (space.axis >= 0) cut(part, space, a, b);
    else if (objects.axis >= 0)
      divide(part, [&](const Ref& r) { return map.below(r, objects.axis, objects.bin); }, a, b);
    else if (part.refs.size() > options_.max_leaf) halve(part, a, b);
    else return false;
    const double left = double(a.refs.size()), right = double(b.refs.size());
    const double spare = part.spare - (left + right - double(part.refs.size()));
    a.spare = spare * left / (left + right);
    b.spare = spare * right / (left + right);
    return true;
  }

  /// The best plane where it is better than the best division of the refs; axis -1: none.
  SpaceSplit best_space(const Part& part, const Split& objects) const {
    SpaceSplit best;
    const size_t count = part.refs.size();
    if (part.spare < 1 || (objects.axis >= 0 && !overlap(objects, half_area(part.box))))
      return best;
    for (int k = 0; k < 3; ++k) {
      const Planes planes(part.box, k);
      if (!planes.sound()) continue;
      SpaceBins bins;
      for (const Ref& r : part.refs) bins.add(r, planes, corners_);
      bins.best(planes, best);
    }
    const double unit = double(Areas(part.box).unit[0]);
    const bool better =
        best.axis >= 0 && double(best.cost) * unit * unit < 0.99 * double(objects.cost);
    const bool fits = best.left < count && best.right < count &&
                      double(best.left + best.right - count) <= part.spare;
    return better && fits ? best : SpaceSplit{};
  }
  bool overlap(const Split& s, double area) const {
    const Box both{upper(s.left_box.lo, s.right_box.lo), lower(s.left_box.hi, s.right_box.hi)};
    for (int k = 0; k < 3; ++k)
      if (!(both.lo[k] <= both.hi[k])) return false;
    return half_area(both) > std::max(kOverlap * area, kSceneOverlap * scene_);
  }

  /// Cuts the refs that lie across a plane, unless leaving one whole on a side costs less.
  void cut(const Part& part, const SpaceSplit& space, Part& a, Part& b) const {
    double left = double(space.left), right = double(space.right);
    const double left_area = half_area(space.left_box), right_area = half_area(space.right_box);
    for (const Ref& r : part.refs) {
      const bool is_left = r.lo[space.axis]<space.at, is_right = r.hi[space.axis]> space.at;
      if (is_left && is_right) {
        Box wide_left = space.left_box, wide_right = space.right_box;
        wide_left.add(box_of(r));
        wide_right.add(box_of(r));
        const double both = left_area * left + right_area * right;
        const double all_left = half_area(wide_left) * left + right_area * (right - 1);
        const double all_right = left_area * (left - 1) + half_area(wide_right) * right;
        if (both < all_left && both < all_right) {
          add_halves(r, space, a, b);
          continue;
        }
        if (all_left < all_right) {
          add(a, r);
          right -= 1;
        } else {
          add(b, r);
          left -= 1;
        }
      } else {
        add(is_left ? a : b, r);
      }
    }
    if (a.refs.empty() || b.refs.empty()) {
      a = Part{};
      b = Part{};
      halve(part, a, b);
    }
  }
  void add_halves(const Ref& r, const SpaceSplit& space, Part& a, Part& b) const {
    Vec3d corner[3];
    corners_(r, corner);
    for (const bool above : {false, true}) {
      const Ref half = half_of(r, corner, space.axis, double(space.at), above);
      if (half.lo[0] <= half.hi[0] && half.lo[1] <= half.hi[1] && half.lo[2] <= half.hi[2])
        add(above ? b : a, half);
    }
  }
  template <class Left>
  static void divide(const Part& part, Left left, Part& a, Part& b) {
    for (const Ref& r : part.refs) add(left(r) ? a : b, r);
  }
  static void halve(const Part& part, Part& a, Part& b) {
    const size_t half = part.refs.size() / 2;
    for (size_t k = 0; k < part.refs.size(); ++k) add(k < half ? a : b, part.refs[k]);
  }
  static void add(Part& part, const Ref& r) {
    part.refs.push_back(r);
    part.box.add(box_of(r));
  }

  const CornersOf& corners_;
  const BuildOptions& options_;
  const double scene_;  // half its surface
  const size_t sah_threshold_;
  const std::atomic<bool>& cancel_;
  Bins bins_;
};

/// The tasks' nodes and leaves behind those of the top.
NodeTree join(Maker& top, std::vector<Maker>& makers, const std::vector<ChildRef>& roots,
              ChildRef root, Buffer<Ref>& refs) {
  size_t nodes = top.nodes.size(), leaves = top.leaves.size();
  std::vector<size_t> first_node, first_leaf;
  for (const Maker& m : makers) {
    first_node.push_back(nodes);
    first_leaf.push_back(leaves);
    nodes += m.nodes.size();
    leaves += m.leaves.size();
  }
  if (leaves > size_t(kOrdinal)) throw std::bad_alloc();
  const auto moved = [&](ChildRef c, size_t k) {
    return ChildRef(c + (c & kLeaf ? first_leaf[k] : first_node[k]));
  };
  for (size_t k = 0; k < makers.size(); ++k) {
    const Maker::Task& task = top.later[k];
    top.nodes[task.node].child[task.lane] = moved(roots[k], k);
  }
  NodeTree tree{Buffer<Node>(nodes), root, {}};
  refs = Buffer<Ref>(leaves);
  std::copy(top.nodes.begin(), top.nodes.end(), tree.nodes.data.get());
  std::copy(top.leaves.begin(), top.leaves.end(), refs.data.get());
  for (size_t k = 0; k < makers.size(); ++k) {
    move_nodes(makers[k].nodes, tree.nodes.data.get() + first_node[k],
               [&](ChildRef c) { return moved(c, k); });
    std::copy(makers[k].leaves.begin(), makers[k].leaves.end(), refs.data.get() + first_leaf[k]);
  }
  return tree;
}

}  // namespace

NodeTree build_spatial(Buffer<Ref>& refs, const CornersOf& corners, const BuildOptions& options,
                       ThreadPool& pool, const std::atomic<bool>& cancel) {
  Part all;
  all.refs.assign(refs.data.get(), refs.data.get() + refs.size);
  all.box = ref_box(refs.data.get(), refs.data.get() + refs.size);
  all.spare = kMostCuts * double(refs.size);
  refs = {};
  const Box box = all.box;
  const double scene = half_area(box);
  Maker top(corners, options, scene, std::max(kTask, all.refs.size() / 64), cancel);
  const ChildRef root = top.make(all, 0);
  std::vector<Maker> makers(top.later.size(), Maker(corners, options, scene, 0, cancel));
  std::vector<ChildRef> roots(makers.size());
  pool.run(makers.size(),
           [&](size_t k) { roots[k] = makers[k].make(top.later[k].part, top.later[k].depth); });
  NodeTree tree = join(top, makers, roots, root, refs);
  tree.box = box;
  return tree;
}

}  // namespace glint
