#include "builder.h"

#include <algorithm>
#include <new>

namespace glint {
namespace {

constexpr int kMaxBins = 32;
constexpr size_t kChunk = 16384;    // of a loop shared by threads
constexpr int kMedianDepth = 40;    // from here on ranges are halved, so that kMaxDepth holds: 2^28 refs are 28 halvings away

/// Refs [begin, end), their box and the box of their centroids.
struct Range {
  size_t begin = 0, end = 0;
  Box box;
  size_t count() const { return end - begin; }
};

struct Bin {
  Box box;
  uint32_t count = 0;
};

/// Where a centroid's bin is along each axis.
struct BinMap {
  F4 origin, scale;
  int count;

  BinMap(const Box& centroids, size_t refs) : origin(centroids.lo), scale(splat(0)) {
    count = int(std::min<size_t>(kMaxBins, 4 + refs / 16));
    for (int k = 0; k < 3; ++k) {
      float extent = centroids.hi[k] - centroids.lo[k];
      if (extent > 1e-35f && extent <= std::numeric_limits<float>::max()) scale[k] = 0.9999f * float(count) / extent;
    }
  }
  I4 operator()(const Ref& r) const {
    I4 bin = __builtin_convertvector((centroid(r) - origin) * scale, I4);
    const I4 last = {count - 1, count - 1, count - 1, 0};
    bin = bin & (bin > 0);
    const I4 over = bin > last;
    return (last & over) | (bin & ~over);
  }
};

struct Bins {
  Bin bin[3][kMaxBins];

  void clear(int count) {
    for (auto& axis : bin) std::fill_n(axis, count, Bin{});
  }
  void add(const Ref* first, const Ref* last, const BinMap& map) {
    for (const Ref* r = first; r != last; ++r) {
      const I4 b = map(*r);
      const Box box{low(*r), high(*r)};
      for (int k = 0; k < 3; ++k) bin[k][b[k]].box.add(box), ++bin[k][b[k]].count;
    }
  }
  void add(const Bins& other, int count) {
    for (int k = 0; k < 3; ++k)
      for (int b = 0; b < count; ++b) bin[k][b].box.add(other.bin[k][b].box), bin[k][b].count += other.bin[k][b].count;
  }
};

/// Refs whose bin along `axis` is below `bin` go left. Axis -1: no split found.
struct Split {
  int axis = -1, bin = 0;
  float cost = std::numeric_limits<float>::infinity();
  size_t left = 0;
  Box left_box, right_box;
};

/// Half the surface of a box whose edges are measured in units of 1 / scale; 0 where that is not a number.
float half_area(const Box& b, float scale) {
  const F4 e = (b.hi - b.lo) * splat(scale);
  const float a = e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  return a > 0 ? a : 0;
}

/// 1 / longest edge, or 0 where that is not a sound number.
float area_scale(const Box& b) {
  const F4 e = b.hi - b.lo;
  const float m = std::max({e[0], e[1], e[2]});
  return m > 1e-35f && m <= std::numeric_limits<float>::max() ? 1 / m : 0;
}

void sweep(const Bin* bin, int axis, int count, float scale, Split& best) {
  Box right_box[kMaxBins];
  float right_cost[kMaxBins];
  uint32_t right = 0;
  Box box;
  for (int b = count - 1; b > 0; --b) {
    box.add(bin[b].box), right += bin[b].count;
    right_box[b] = box, right_cost[b] = right ? half_area(box, scale) * float(right) : -1;
  }
  box = Box{};
  size_t left = 0;
  for (int b = 1; b < count; ++b) {
    box.add(bin[b - 1].box), left += bin[b - 1].count;
    if (left == 0 || right_cost[b] < 0) continue;
    const float cost = half_area(box, scale) * float(left) + right_cost[b];
    if (cost < best.cost) best = {axis, b, cost, left, box, right_box[b]};
  }
}

Split best_split(const Bins& bins, const BinMap& map, const Box& box) {
  Split best;
  const float scale = area_scale(box);
  for (int k = 0; k < 3; ++k)
    if (map.scale[k] > 0 && scale > 0) sweep(bins.bin[k], k, map.count, scale, best);
  return best;
}

Box centroid_box(const Ref* first, const Ref* last) {
  Box box;
  for (const Ref* r = first; r != last; ++r) box.add(centroid(*r));
  return box;
}
Box ref_box(const Ref* first, const Ref* last) {
  Box box;
  for (const Ref* r = first; r != last; ++r) box.add(Box{low(*r), high(*r)});
  return box;
}

/// What all parts of one build share.
struct Shared {
  Ref* refs;
  Ref* scratch;
  BuildOptions options;
  Team& team;
  const std::atomic<bool>& cancel;

  void check_cancel() const {
    if (cancel.load(std::memory_order_relaxed)) throw Cancelled{};
  }
  /// body(chunk, first, last) for pieces of [begin, end); `chunks` says how many there are.
  static size_t chunks(const Range& r) { return (r.count() + kChunk - 1) / kChunk; }
  template <class Body>
  void each_chunk(const Range& r, Body body) const {
    team.run(chunks(r), [&](size_t c) { body(c, r.begin + c * kChunk, std::min(r.end, r.begin + (c + 1) * kChunk)); });
  }
};

/// One thread's steps on a range.
struct SerialSteps {
  const Shared& s;
  Bins bins;

  Box centroids(const Range& r) { return centroid_box(s.refs + r.begin, s.refs + r.end); }
  void bin(const Range& r, const BinMap& map) {
    bins.clear(map.count);
    bins.add(s.refs + r.begin, s.refs + r.end, map);
  }
  /// Stable and without branches: every ref is written to both sides, and only one side moves on.
  void partition(const Range& r, const BinMap& map, const Split& split) {
    Ref *left = s.refs + r.begin, *right = s.scratch + r.begin;
    for (const Ref *p = left, *end = s.refs + r.end; p != end; ++p) {
      const Ref ref = *p;
      const bool is_left = map(ref)[split.axis] < split.bin;
      *left = ref, *right = ref;
      left += is_left, right += !is_left;
    }
    std::copy(s.scratch + r.begin, right, left);
  }
};

/// The same steps by all threads, with the same results: boxes and counts do not depend on the order, and the partition is stable.
struct SharedSteps {
  const Shared& s;
  Bins bins;

  Box centroids(const Range& r) {
    std::vector<Box> part(Shared::chunks(r));
    s.each_chunk(r, [&](size_t c, size_t first, size_t last) { part[c] = centroid_box(s.refs + first, s.refs + last); });
    Box box;
    for (const Box& b : part) box.add(b);
    return box;
  }
  void bin(const Range& r, const BinMap& map) {
    const size_t groups = std::min(Shared::chunks(r), 4 * s.team.size()), each = (r.count() + groups - 1) / groups;
    std::vector<Bins> part(groups);
    s.team.run(groups, [&](size_t g) {
      part[g].add(s.refs + std::min(r.end, r.begin + g * each), s.refs + std::min(r.end, r.begin + (g + 1) * each), map);
    });
    bins.clear(map.count);
    for (const Bins& b : part) bins.add(b, map.count);
  }
  void partition(const Range& r, const BinMap& map, const Split& split) {
    std::vector<size_t> left(Shared::chunks(r) + 1, 0);
    auto is_left = [&](const Ref& ref) { return map(ref)[split.axis] < split.bin; };
    s.each_chunk(r, [&](size_t c, size_t first, size_t last) {
      left[c + 1] = size_t(std::count_if(s.refs + first, s.refs + last, is_left));
    });
    for (size_t c = 1; c < left.size(); ++c) left[c] += left[c - 1];
    s.each_chunk(r, [&](size_t c, size_t first, size_t last) {
      Ref *a = s.scratch + r.begin + left[c], *b = s.scratch + r.begin + split.left + (first - r.begin - left[c]);
      for (size_t k = first; k < last; ++k) *(is_left(s.refs[k]) ? a++ : b++) = s.refs[k];
    });
    s.each_chunk(r, [&](size_t, size_t first, size_t last) { std::copy(s.scratch + first, s.scratch + last, s.refs + first); });
  }
};

/// Halves a range at the median centroid of its longest axis; by position when all centroids are one.
void split_median(const Shared& s, const Range& r, const Box& centroids, Range& a, Range& b) {
  const F4 e = centroids.hi - centroids.lo;
  const int axis = e[0] >= e[1] && e[0] >= e[2] ? 0 : e[1] >= e[2] ? 1 : 2;
  Ref *first = s.refs + r.begin, *last = s.refs + r.end, *middle = first + r.count() / 2;
  auto before = [axis](const Ref& p, const Ref& q) {
    const float x = centroid(p)[axis], y = centroid(q)[axis];
    return x != y ? x < y : p.source != q.source ? p.source < q.source : p.primitive < q.primitive;
  };
  if (e[axis] > 0) std::nth_element(first, middle, last, before);
  const size_t cut = size_t(middle - s.refs);
  a = {r.begin, cut, ref_box(first, middle)}, b = {cut, r.end, ref_box(middle, last)};
}

/// Two parts of a range. False, with the range as it was, when a range that may be a leaf has no useful split.
template <class Steps>
bool split_range(Steps& steps, const Range& r, int depth, Range& a, Range& b) {
  const Box centroids = steps.centroids(r);
  const BinMap map(centroids, r.count());
  Split split;
  if (depth < kMedianDepth) {
    steps.bin(r, map);
    split = best_split(steps.bins, map, r.box);
  }
  if (split.axis < 0) {
    if (r.count() <= steps.s.options.max_leaf) return false;
    split_median(steps.s, r, centroids, a, b);
    return true;
  }
  steps.partition(r, map, split);
  a = {r.begin, r.begin + split.left, split.left_box}, b = {r.begin + split.left, r.end, split.right_box};
  return true;
}

ChildRef leaf_ref(const Range& r) { return kLeaf | ChildRef(r.count() - 1) << kCountShift | ChildRef(r.begin); }

void set_child(Node& node, int lane, const Box* box) {
  const float inf = std::numeric_limits<float>::infinity();
  for (int k = 0; k < 3; ++k) {
    node.planes[2 * k][lane] = box ? box->lo[k] : inf;
    node.planes[2 * k + 1][lane] = box ? box->hi[k] : -inf;
  }
  node.child[lane] = 0;
}

/// A range whose nodes another thread makes, and the place in the top nodes where they belong.
struct Task {
  size_t node;
  int lane;
  int depth;
  Range range;
};

/// Appends the nodes over a range to `nodes`. With `tasks`, ranges of at most `task_size` refs are left to others.
template <class Steps>
struct NodeMaker {
  Steps steps;
  std::vector<Node> nodes;
  std::vector<Task>* tasks = nullptr;
  size_t task_size = 0;

  ChildRef make(const Range& r, int depth) {
    if (r.count() <= steps.s.options.max_leaf) return leaf_ref(r);
    steps.s.check_cancel();
    Range children[kWidth];
    const int count = open(r, depth, children);
    const size_t index = nodes.size();
    nodes.emplace_back();
    for (int k = 0; k < kWidth; ++k) set_child(nodes[index], k, k < count ? &children[k].box : nullptr);
    for (int k = 0; k < count; ++k) {
      if (tasks && children[k].count() <= task_size) {
        tasks->push_back({index, k, depth + 1, children[k]});
      } else {
        const ChildRef child = make(children[k], depth + 1);
        nodes[index].child[k] = child;
      }
    }
    return ChildRef(index);
  }

  /// Splits the child with the largest box until there are eight or none is worth it.
  int open(const Range& r, int depth, Range* children) {
    const float scale = area_scale(r.box);
    float area[kWidth] = {half_area(r.box, scale)};
    int count = 1;
    children[0] = r;
    for (int k; count < kWidth && (k = largest(children, area, count)) >= 0;) {
      Range a, b;
      if (!split_range(steps, children[k], depth, a, b)) {
        area[k] = -1;
        continue;
      }
      children[k] = a, children[count] = b;
      area[k] = half_area(a.box, scale), area[count] = half_area(b.box, scale);
      ++count;
    }
    return count;
  }

  int largest(const Range* children, const float* area, int count) const {
    int best = -1;
    for (int k = 0; k < count; ++k) {
      if (area[k] < 0 || children[k].count() <= steps.s.options.min_leaf) continue;
      if (best < 0 || area[k] > area[best] || (area[k] == area[best] && children[k].count() > children[best].count())) best = k;
    }
    return best;
  }
};

/// Puts the nodes of the tasks behind the top nodes and joins them.
NodeTree join(std::vector<Node>& top, ChildRef root, const std::vector<Task>& tasks, std::vector<std::vector<Node>>& parts,
              const std::vector<ChildRef>& roots, Team& team) {
  std::vector<size_t> base(tasks.size() + 1, top.size());
  for (size_t k = 0; k < tasks.size(); ++k) base[k + 1] = base[k] + parts[k].size();
  auto moved = [&](ChildRef c, size_t k) { return c & kLeaf ? c : ChildRef(c + base[k]); };
  for (size_t k = 0; k < tasks.size(); ++k) top[tasks[k].node].child[tasks[k].lane] = moved(roots[k], k);
  NodeTree tree{Buffer<Node>(base.back()), root, {}};
  std::copy(top.begin(), top.end(), tree.nodes.data.get());
  team.run(tasks.size(), [&](size_t k) {
    Node* out = tree.nodes.data.get() + base[k];
    for (Node node : parts[k]) {
      for (int lane = 0; lane < kWidth; ++lane)
        if (node.planes[0][lane] <= node.planes[1][lane]) node.child[lane] = moved(node.child[lane], k);
      *out++ = node;
    }
    std::vector<Node>().swap(parts[k]);
  });
  return tree;
}

}  // namespace

NodeTree build_nodes(Ref* refs, size_t count, const BuildOptions& options, Team& team, const std::atomic<bool>& cancel) {
  if (count > size_t(kOrdinal)) throw std::bad_alloc();
  Buffer<Ref> scratch(count);
  const Shared shared{refs, scratch.data.get(), options, team, cancel};
  Range all{0, count, {}};
  std::vector<Box> part(Shared::chunks(all));
  shared.each_chunk(all, [&](size_t c, size_t first, size_t last) { part[c] = ref_box(refs + first, refs + last); });
  for (const Box& b : part) all.box.add(b);

  std::vector<Task> tasks;
  NodeMaker<SharedSteps> top{{shared, {}}, {}, &tasks, std::max<size_t>(count / 16, 8192)};
  if (count <= top.task_size) {
    NodeMaker<SerialSteps> maker{{shared, {}}, {}};
    const ChildRef root = maker.make(all, 0);
    std::vector<std::vector<Node>> none;
    NodeTree tree = join(maker.nodes, root, {}, none, {}, team);
    tree.box = all.box;
    return tree;
  }
  const ChildRef root = top.make(all, 0);
  std::vector<std::vector<Node>> nodes(tasks.size());
  std::vector<ChildRef> roots(tasks.size());
  team.run(tasks.size(), [&](size_t k) {
    NodeMaker<SerialSteps> maker{{shared, {}}, {}};
    maker.nodes.reserve(tasks[k].range.count() / 16);
    roots[k] = maker.make(tasks[k].range, tasks[k].depth);
    nodes[k] = std::move(maker.nodes);
  });
  scratch = {};
  NodeTree tree = join(top.nodes, root, tasks, nodes, roots, team);
  tree.box = all.box;
  return tree;
}

}  // namespace glint
