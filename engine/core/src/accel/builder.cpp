#include "builder.h"

#include <algorithm>
#include <new>

#include "builder_grid.h"
#include "builder_split.h"

namespace glint {
namespace {

constexpr size_t kBig = 16384;      // refs: beyond, a range is cut into clusters by all threads
constexpr size_t kTask = 4096;      // refs: below, nodes are not made over clusters any more but over their refs
constexpr int kMedianDepth = 40;    // from here on ranges are halved, so that kMaxDepth holds: 2^28 refs are 28 halvings away

/// What a ref weighs: itself, or all that its cluster holds.
struct Single {
  static uint32_t weight(const Ref&) { return 1; }
};
struct Cluster {
  static uint32_t weight(const Ref& r) { return r.source; }
};

void sweep(const Bins& bins, int axis, int count, Split& best) {
  const Box* box = bins.box[axis];
  const uint32_t* weight = bins.count[axis];
  Box right_box[kMaxBins], all;
  double right_cost[kMaxBins];
  uint32_t right = 0;
  for (int b = count - 1; b > 0; --b) {
    all.add(box[b]), right += weight[b];
    right_box[b] = all, right_cost[b] = right ? half_area(all) * right : -1;
  }
  all = Box{};
  size_t left = 0;
  for (int b = 1; b < count; ++b) {
    all.add(box[b - 1]), left += weight[b - 1];
    if (left == 0 || right_cost[b] < 0) continue;
    const double cost = half_area(all) * double(left) + right_cost[b];
    if (cost < best.cost) best = {axis, b, cost, left, all, right_box[b]};
  }
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
  Split best_split(const BinMap& map) const {
    Split best;
    for (int k = 0; k < 3; ++k)
      if (map.scale[k] > 0) sweep(bins, k, map.count, best);
    return best;
  }
  /// Stable and without branches: every ref is written to both sides, and only one side moves on. Returns where the right side begins.
  size_t partition(const Range& r, const BinMap& map, const Split& split) {
    Ref *left = refs + r.begin, *right = scratch + r.begin;
    for (const Ref *p = left, *end = refs + r.end; p != end; ++p) {
      const Ref ref = *p;
      const bool is_left = map(ref)[split.axis] < split.bin;
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
    const size_t cut = size_t(middle - refs);
    a = {r.begin, cut, weigh(first, middle), ref_box(first, middle)}, b = {cut, r.end, weigh(middle, last), ref_box(middle, last)};
  }
  /// False, with the range as it was, when a range that may be a leaf has no useful split.
  bool split(const Range& r, int depth, Range& a, Range& b) {
    const Box centroids = centroid_box(refs + r.begin, refs + r.end);
    const BinMap map(centroids, r.count());
    Split best;
    if (depth < kMedianDepth) {
      bin(r, map);
      best = best_split(map);
    }
    if (best.axis < 0) {
      if (r.count() <= options.max_leaf) return false;
      split_median(r, centroids, a, b);
      return true;
    }
    const size_t cut = partition(r, map, best);
    a = {r.begin, cut, best.left, best.left_box}, b = {cut, r.end, r.weight - best.left, best.right_box};
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

/// Appends the nodes over a range to `nodes`. Children of weight max_leaf or less are not opened further: leaf(range, node, lane, depth)
/// gives what they refer to.
template <class Weight, class Leaf>
struct NodeMaker {
  Splitter<Weight> splitter;
  std::vector<Node>& nodes;
  const std::atomic<bool>& cancel;
  size_t max_leaf;
  Leaf leaf;

  ChildRef make(const Range& r, int depth) {
    if (cancel.load(std::memory_order_relaxed)) throw Cancelled{};
    Range children[kWidth];
    const int count = open(r, depth, children);
    const size_t index = nodes.size();
    nodes.emplace_back();
    for (int k = 0; k < kWidth; ++k) set_child(nodes[index], k, k < count ? &children[k].box : nullptr);
    for (int k = 0; k < count; ++k) {
      const bool small = children[k].count() == 1 || children[k].weight <= max_leaf;
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
      if (area[k] < 0 || children[k].count() <= splitter.options.min_leaf) continue;
      if (best < 0 || area[k] > area[best] || (area[k] == area[best] && children[k].count() > children[best].count())) best = k;
    }
    return best;
  }
};

ChildRef leaf_ref(const Range& r) { return kLeaf | ChildRef(r.count() - 1) << kCountShift | ChildRef(r.begin); }

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

  void add(const Task& task) { (task.range.count() > kBig ? big_ : small_).push_back(task); }
  void place(const Task& task, ChildRef child) { (task.node == kNoNode ? root_ : top_[task.node].child[task.lane]) = child; }

  /// The nodes over the clusters of a range, and tasks for what is below. A range that the grid cannot part is left to one thread.
  void part(const Task& task) {
    std::vector<Ref> clusters = make_clusters(refs_, scratch_.data.get(), task.range, team_), spare(clusters.size());
    if (clusters.size() == 1) return small_.push_back(task);
    std::vector<Task> found;
    const auto later = [&](const Range& r, size_t node, int lane, int depth) {
      found.push_back({node, lane, depth, r});
      return ChildRef(0);
    };
    NodeMaker<Cluster, decltype(later)> maker{{clusters.data(), spare.data(), {1, 1}, {}}, top_, cancel_, kTask, later};
    place(task, maker.make({0, clusters.size(), task.range.count(), task.range.box}, task.depth));
    const std::vector<size_t> at = gather_clusters(refs_, scratch_.data.get(), task.range.begin, clusters, team_);
    for (Task t : found) {
      t.range.begin = at[t.range.begin], t.range.end = at[t.range.end];
      add(t);
    }
  }

  void make_batches() {
    size_t total = 0, open = 0;
    for (const Task& t : small_) total += t.range.count();
    for (size_t k = 0; k < small_.size(); ++k) {
      if (open == 0) batches_.push_back({k, k, {}, {}});
      open += small_[k].range.count(), batches_.back().last = k + 1;
      if (open > total / 64) open = 0;
    }
    team_.run(batches_.size(), [&](size_t k) { fill(batches_[k]); });
    scratch_ = {};
  }

  void fill(Batch& batch) {
    const auto leaf = [](const Range& r, size_t, int, int) { return leaf_ref(r); };
    NodeMaker<Single, decltype(leaf)> maker{{refs_, scratch_.data.get(), options_, {}}, batch.nodes, cancel_, options_.max_leaf, leaf};
    for (size_t k = batch.first; k < batch.last; ++k) {
      const Range& r = small_[k].range;
      batch.roots.push_back(r.count() <= options_.max_leaf ? leaf_ref(r) : maker.make(r, small_[k].depth));
    }
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
  Range all{0, count, count, {}};
  for (const Box& b : part) all.box.add(b);
  return TreeMaker(refs, count, options, team, cancel).make(all);
}

}  // namespace glint
