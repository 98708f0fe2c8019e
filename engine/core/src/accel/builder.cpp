#include "builder.h"

#include <algorithm>
#include <new>

#include "builder_grid.h"
#include "builder_split.h"

namespace glint {
namespace {

constexpr size_t kBig = 16384;      // refs: beyond, a range is cut into clusters by all threads
constexpr size_t kTask = 4096;      // refs: below, a range is the work of one thread
constexpr size_t kCluster = 16;     // refs: of the clusters of big ranges
constexpr int kMedianDepth = 40;    // from here on ranges are halved, so that kMaxDepth holds: 2^28 refs are 28 halvings away

/// What a ref weighs: itself, or all that its cluster holds.
struct Single {
  static uint32_t weight(const Ref&) { return 1; }
};
struct Cluster {
  static uint32_t weight(const Ref& r) { return r.source; }
};

/// Half the surfaces of three boxes of a range, in units that make the range's own extents at most 1: lane k is that of box[k].
struct Areas {
  F4 unit;
  explicit Areas(const Box& range) {
    const F4 e = extent(range);
    const float longest = std::max({e[0], e[1], e[2], std::numeric_limits<float>::min()});
    unit = splat(longest <= std::numeric_limits<float>::max() ? 1 / longest : 0);
  }
  F4 operator()(const Box (&box)[3]) const {
    const F4 p = extent(box[0]) * unit, q = extent(box[1]) * unit, r = extent(box[2]) * unit;
    const F4 x{p[0], q[0], r[0], 0}, y{p[1], q[1], r[1], 0}, z{p[2], q[2], r[2], 0};
    return x * (y + z) + y * z;
  }
};

/// What lies on one side of a bin along each axis.
struct Grown {
  Box box[3];
  F4 weight{};
  void add(const Bins& bins, int b) {
    for (int k = 0; k < 3; ++k) box[k].add(bins.box[k][b]);
    weight += F4{float(bins.count[0][b]), float(bins.count[1][b]), float(bins.count[2][b]), 0};
  }
};

/// The cheapest split of a range. Costs that are not numbers, from a side without boxes or from infinite extents, are never the cheapest.
Split best_split(const Bins& bins, const BinMap& map, const Areas& areas) {
  F4 right_cost[kMaxBins], lowest = splat(std::numeric_limits<float>::infinity());
  I4 at{};
  Grown right, left;
  for (int b = map.count - 1; b > 0; --b) right.add(bins, b), right_cost[b] = areas(right.box) * right.weight;
  for (int b = 1; b < map.count; ++b) {
    left.add(bins, b - 1);
    const F4 cost = areas(left.box) * left.weight + right_cost[b];
    const I4 lower_here = cost < lowest;
    lowest = F4((I4(cost) & lower_here) | (I4(lowest) & ~lower_here)), at = (lower_here & b) | (at & ~lower_here);
  }
  Split best;
  for (int k = 0; k < 3; ++k)
    if (lowest[k] < best.cost) best.axis = k, best.bin = at[k], best.cost = lowest[k];
  if (best.axis < 0) return best;
  for (int b = 0; b < map.count; ++b) (b < best.bin ? best.left_box : best.right_box).add(bins.box[best.axis][b]);
  for (int b = 0; b < best.bin; ++b) best.left += bins.count[best.axis][b];
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

/// Parts ranges of refs[…) in two; scratch has room for as many.
template <class Weight>
struct Splitter {
  Ref* refs;
  Ref* scratch;
  BuildOptions options;
  Bins bins;

  void bin(const Range& r, const BinMap& map) {
    bins.clear(map.count);
    for (const Ref *p = refs + r.begin, *end = refs + r.end; p != end; ++p) {
      const I4 b = map(*p);
      const Box box{low(*p), high(*p)};
      for (int k = 0; k < 3; ++k) bins.box[k][b[k]].add(box), bins.count[k][b[k]] += Weight::weight(*p);
    }
  }
  /// Stable and without branches: every ref is written to both sides, and only one side moves on. Returns where the right side begins.
  size_t partition(const Range& r, const BinMap& map, const Split& split) {
    Ref *left = refs + r.begin, *right = scratch + r.begin;
    for (const Ref *p = left, *end = refs + r.end; p != end; ++p) {
      const Ref ref = *p;
      const bool is_left = map.below(ref, split.axis, split.bin);
      *left = ref, *right = ref;
      left += is_left, right += !is_left;
    }
    std::copy(scratch + r.begin, right, left);
    return size_t(left - refs);
  }
  static size_t weigh(const Ref* first, const Ref* last) {
    size_t sum = 0;
    for (; first != last; ++first) sum += Weight::weight(*first);
    return sum;
  }
  /// Halves a range at the median centroid of its longest axis; by position when all centroids are one.
  void split_median(const Range& r, const Box& centroids, Range& a, Range& b) {
    const F4 e = centroids.hi - centroids.lo;
    const int axis = e[0] >= e[1] && e[0] >= e[2] ? 0 : e[1] >= e[2] ? 1 : 2;
    Ref *first = refs + r.begin, *last = refs + r.end, *middle = first + r.count() / 2;
    auto before = [axis](const Ref& p, const Ref& q) {
      const float x = centroid(p)[axis], y = centroid(q)[axis];
      return x != y ? x < y : p.source != q.source ? p.source < q.source : p.primitive < q.primitive;
    };
    if (e[axis] > 0) std::nth_element(first, middle, last, before);
    split_at(r, size_t(middle - refs), a, b);
  }
  void split_at(const Range& r, size_t cut, Range& a, Range& b) const {
    const size_t left = weigh(refs + r.begin, refs + cut);
    a = {r.begin, cut, r.first, left, ref_box(refs + r.begin, refs + cut)};
    b = {cut, r.end, r.first + left, r.weight - left, ref_box(refs + cut, refs + r.end)};
  }
  /// False, with the range as it was, when a range that may be a leaf has no useful split.
  bool split(const Range& r, int depth, Range& a, Range& b) {
    if (r.count() == 2 && r.weight > options.max_leaf) return split_at(r, r.begin + 1, a, b), true;
    const Box centroids = centroid_box(refs + r.begin, refs + r.end);
    const BinMap map(centroids, r.count());
    Split best;
    if (depth < kMedianDepth) {
      bin(r, map);
      best = best_split(bins, map, Areas(r.box));
    }
    if (best.axis < 0) {
      if (r.weight <= options.max_leaf) return false;
      split_median(r, centroids, a, b);
      return true;
    }
    const size_t cut = partition(r, map, best);
    a = {r.begin, cut, r.first, best.left, best.left_box};
    b = {cut, r.end, r.first + best.left, r.weight - best.left, best.right_box};
    return true;
  }
};

void set_child(Node& node, int lane, const Box* box) {
  const float inf = std::numeric_limits<float>::infinity();
  for (int k = 0; k < 3; ++k) {
    node.planes[2 * k][lane] = box ? box->lo[k] : inf;
    node.planes[2 * k + 1][lane] = box ? box->hi[k] : -inf;
  }
  node.child[lane] = 0;
}

/// A range of refs whose nodes are still to be made, and the place in the top nodes where they belong.
struct Task {
  size_t node;
  int lane;
  int depth;
  Range range;
};

ChildRef leaf_ref(const Range& r) { return kLeaf | ChildRef(r.weight - 1) << kCountShift | ChildRef(r.first); }

/// Appends the nodes over a range to `nodes`. Children that weigh `crowd` or less are not opened further: leaf(range, node, lane, depth)
/// gives what they refer to.
template <class Weight, class Leaf>
struct NodeMaker {
  Splitter<Weight> splitter;
  std::vector<Node>& nodes;
  const std::atomic<bool>& cancel;
  size_t crowd;
  Leaf leaf;

  ChildRef make(const Range& r, int depth) {
    if (cancel.load(std::memory_order_relaxed)) throw Cancelled{};
    Range children[kWidth];
    const int count = open(r, depth, children);
    const size_t index = nodes.size();
    nodes.emplace_back();
    for (int k = 0; k < kWidth; ++k) set_child(nodes[index], k, k < count ? &children[k].box : nullptr);
    for (int k = 0; k < count; ++k) {
      const bool small = children[k].count() == 1 || children[k].weight <= crowd;
      const ChildRef child = small ? leaf(children[k], index, k, depth + 1) : make(children[k], depth + 1);
      nodes[index].child[k] = child;
    }
    return ChildRef(index);
  }

  /// Splits the child with the largest box until there are eight or none is worth it.
  int open(const Range& r, int depth, Range* children) {
    double area[kWidth] = {half_area(r.box)};
    int count = 1;
    children[0] = r;
    for (int k; count < kWidth && (k = largest(children, area, count)) >= 0;) {
      Range a, b;
      if (!splitter.split(children[k], depth, a, b)) {
        area[k] = -1;
        continue;
      }
      children[k] = a, children[count] = b;
      area[k] = half_area(a.box), area[count] = half_area(b.box);
      ++count;
    }
    return count;
  }

  int largest(const Range* children, const double* area, int count) const {
    int best = -1;
    for (int k = 0; k < count; ++k) {
      if (area[k] < 0 || children[k].count() == 1 || children[k].weight <= splitter.options.min_leaf) continue;
      if (best < 0 || area[k] > area[best] || (area[k] == area[best] && children[k].weight > children[best].weight)) best = k;
    }
    return best;
  }
};

/// Appends the nodes over the cells of a grid, halving those with the most refs.
class Halver {
 public:
  Halver(const Ref* refs, const std::vector<size_t>& start, const BuildOptions& options, std::vector<Node>& nodes)
      : refs_(refs), start_(start), options_(options), nodes_(nodes) {}

  ChildRef make() { return make({0, uint32_t(start_.size() - 1), start_.front(), start_.back()}).ref; }

 private:
  /// Refs [begin, end), those of `count` cells; of no cells once they are a part of one.
  struct Cells {
    uint32_t first, count;
    size_t begin, end;
    size_t refs() const { return end - begin; }
  };
  struct Child {
    ChildRef ref;
    Box box;
  };

  Child make(const Cells& all) {
    if (all.refs() <= options_.max_leaf) return {leaf_ref({0, 0, all.begin, all.refs(), {}}), ref_box(refs_ + all.begin, refs_ + all.end)};
    Cells cells[kWidth] = {all};
    int count = 1;
    for (int k; count < kWidth && cells[k = fullest(cells, count)].refs() > options_.min_leaf; ++count) halve(cells[k], cells[count]);
    const size_t index = nodes_.size();
    nodes_.emplace_back();
    Box box;
    for (int k = 0; k < kWidth; ++k) {
      if (k >= count) { set_child(nodes_[index], k, nullptr); continue; }
      const Child child = make(cells[k]);
      set_child(nodes_[index], k, &child.box), nodes_[index].child[k] = child.ref;
      box.add(child.box);
    }
    return {ChildRef(index), box};
  }
  static int fullest(const Cells* cells, int count) {
    return int(std::max_element(cells, cells + count, [](const Cells& a, const Cells& b) { return a.refs() < b.refs(); }) - cells);
  }
  /// Leaves the first half, neither of them empty; halves without a ref are skipped.
  void halve(Cells& whole, Cells& second) const {
    for (; whole.count > 1; whole.count /= 2) {
      const uint32_t half = whole.count / 2, middle = whole.first + half;
      const size_t cut = start_[middle];
      if (cut == whole.begin) { whole.first = middle; continue; }
      if (cut == whole.end) continue;
      second = {middle, half, cut, whole.end}, whole = {whole.first, half, whole.begin, cut};
      return;
    }
    const size_t cut = whole.begin + whole.refs() / 2;
    second = {0, 0, cut, whole.end}, whole = {0, 0, whole.begin, cut};
  }

  const Ref* refs_;
  const std::vector<size_t>& start_;
  const BuildOptions& options_;
  std::vector<Node>& nodes_;
};

/// The work on one tree: top nodes over clusters, then the nodes below them by all threads.
class TreeMaker {
 public:
  TreeMaker(Ref* refs, size_t count, const BuildOptions& options, Team& team, const std::atomic<bool>& cancel)
      : refs_(refs), scratch_(count), options_(options), team_(team), cancel_(cancel) {}

  NodeTree make(const Range& all) {
    add({kNoNode, 0, 0, all});
    while (!big_.empty()) {
      const Task task = big_.back();
      big_.pop_back();
      part(task);
    }
    make_batches();
    NodeTree tree = join();
    tree.box = all.box;
    return tree;
  }

 private:
  static constexpr size_t kNoNode = SIZE_MAX;
  /// Tasks [first, last) and their nodes.
  struct Batch {
    size_t first, last;
    std::vector<Node> nodes;
    std::vector<ChildRef> roots;
  };

  void add(const Task& task) { (task.range.weight > kBig && task.depth < kMedianDepth ? big_ : small_).push_back(task); }
  void place(const Task& task, ChildRef child) { (task.node == kNoNode ? root_ : top_[task.node].child[task.lane]) = child; }

  /// The top nodes over a range, and tasks for what is below. A range that the grid cannot part is left to one thread.
  void part(const Task& task) {
    std::vector<Task> found;
    const BuildOptions over{1, 1, kCluster, kTask, false};
    const ChildRef root = over_clusters(task, over, team_, top_, found);
    if (found.size() == 1 && found[0].node == kNoNode) return small_.push_back(task);
    place(task, root);
    for (const Task& t : found) add(t);
  }

  /// Makes the nodes over the clusters of a range; `found` are the ranges whose nodes are still to be made, the task itself when there are
  /// no clusters.
  ChildRef over_clusters(const Task& task, const BuildOptions& options, Team& team, std::vector<Node>& nodes, std::vector<Task>& found) {
    std::vector<Ref> clusters = make_clusters(refs_, scratch_.data.get(), task.range, options.cluster, team), spare(clusters.size());
    if (clusters.size() == 1) {
      found.push_back({kNoNode, 0, task.depth, task.range});
      return 0;
    }
    const auto later = [&](const Range& r, size_t node, int lane, int depth) {
      if (r.weight <= options.max_leaf) return leaf_ref(r);
      found.push_back({node, lane, depth, {r.first, r.first + r.weight, r.first, r.weight, r.box}});
      return ChildRef(0);
    };
    NodeMaker<Cluster, decltype(later)> maker{{clusters.data(), spare.data(), options, {}}, nodes, cancel_, options.crowd, later};
    const ChildRef root = maker.make({0, clusters.size(), task.range.first, task.range.weight, task.range.box}, task.depth);
    gather_clusters(refs_, scratch_.data.get(), task.range.first, clusters, team);
    return root;
  }

  void make_batches() {
    size_t total = 0, open = 0;
    for (const Task& t : small_) total += t.range.weight;
    for (size_t k = 0; k < small_.size(); ++k) {
      if (open == 0) batches_.push_back({k, k, {}, {}});
      open += small_[k].range.weight, batches_.back().last = k + 1;
      if (open > total / 64) open = 0;
    }
    team_.run(batches_.size(), [&](size_t k) { fill(batches_[k]); });
    scratch_ = {};
  }

  void fill(Batch& batch) {
    Team alone(1);
    for (size_t k = batch.first; k < batch.last; ++k) batch.roots.push_back(below(small_[k], alone, batch.nodes));
  }

  /// All nodes of a task.
  ChildRef below(const Task& task, Team& alone, std::vector<Node>& nodes) {
    if (task.range.weight <= options_.max_leaf) return leaf_ref(task.range);
    if (options_.halve && task.depth < kMedianDepth) return over_cells(task, alone, nodes);
    if (task.range.weight <= options_.crowd || task.depth >= kMedianDepth) return over_refs(task, nodes);
    std::vector<Task> found;
    ChildRef root = over_clusters(task, options_, alone, nodes, found);
    for (const Task& t : found) (t.node == kNoNode ? root : nodes[t.node].child[t.lane]) = over_refs(t, nodes);
    return root;
  }
  ChildRef over_cells(const Task& task, Team& alone, std::vector<Node>& nodes) {
    if (cancel_.load(std::memory_order_relaxed)) throw Cancelled{};
    const std::vector<size_t> start = sort_into_cells(refs_, scratch_.data.get(), task.range, (options_.max_leaf + 1) / 2, alone);
    return Halver(refs_, start, options_, nodes).make();
  }
  ChildRef over_refs(const Task& task, std::vector<Node>& nodes) {
    const auto leaf = [](const Range& r, size_t, int, int) { return leaf_ref(r); };
    NodeMaker<Single, decltype(leaf)> maker{{refs_, scratch_.data.get(), options_, {}}, nodes, cancel_, options_.max_leaf, leaf};
    return maker.make(task.range, task.depth);
  }

  /// Puts the nodes of the batches behind the top nodes.
  NodeTree join() {
    std::vector<size_t> base(batches_.size() + 1, top_.size());
    for (size_t k = 0; k < batches_.size(); ++k) base[k + 1] = base[k] + batches_[k].nodes.size();
    auto moved = [&](ChildRef c, size_t k) { return c & kLeaf ? c : ChildRef(c + base[k]); };
    for (size_t k = 0; k < batches_.size(); ++k)
      for (size_t t = batches_[k].first; t < batches_[k].last; ++t) place(small_[t], moved(batches_[k].roots[t - batches_[k].first], k));
    NodeTree tree{Buffer<Node>(base.back()), root_, {}};
    std::copy(top_.begin(), top_.end(), tree.nodes.data.get());
    team_.run(batches_.size(), [&](size_t k) {
      Node* out = tree.nodes.data.get() + base[k];
      for (Node node : batches_[k].nodes) {
        for (int lane = 0; lane < kWidth; ++lane)
          if (node.planes[0][lane] <= node.planes[1][lane]) node.child[lane] = moved(node.child[lane], k);
        *out++ = node;
      }
      std::vector<Node>().swap(batches_[k].nodes);
    });
    return tree;
  }

  Ref* refs_;
  Buffer<Ref> scratch_;
  BuildOptions options_;
  Team& team_;
  const std::atomic<bool>& cancel_;
  std::vector<Node> top_;
  ChildRef root_ = 0;
  std::vector<Task> big_, small_;
  std::vector<Batch> batches_;
};

}  // namespace

NodeTree build_nodes(Ref* refs, size_t count, const BuildOptions& options, Team& team, const std::atomic<bool>& cancel) {
  if (count > size_t(kOrdinal)) throw std::bad_alloc();
  const size_t parts = 1 + count / kBig;
  std::vector<Box> part(parts);
  team.run(parts, [&](size_t k) { part[k] = ref_box(refs + count * k / parts, refs + count * (k + 1) / parts); });
  Range all{0, count, 0, count, {}};
  for (const Box& b : part) all.box.add(b);
  return TreeMaker(refs, count, options, team, cancel).make(all);
}

}  // namespace glint
