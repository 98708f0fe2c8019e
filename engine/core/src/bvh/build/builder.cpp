#include "bvh/build/builder.h"

#include <algorithm>
#include <new>

#include "bvh/build/builder_grid.h"
#include "bvh/build/builder_nodes.h"
#include "bvh/build/builder_split.h"
#include "bvh/build/morton_grid.h"

namespace glint {
namespace {

constexpr size_t kBig = 16384;   // refs: beyond, a range is cut into clusters by all threads
constexpr size_t kTask = 4096;   // refs: below, a range is the work of one thread
constexpr size_t kCluster = 16;  // refs: of the clusters of big ranges

/// Parts ranges of refs[…) in two; scratch has room for as many.
template <class Weight>
struct Splitter {
  Ref* refs;
  Ref* scratch;
  BuildOptions options;
  Bins bins;

  /// Stable and without branches: every ref is written to both sides, and only one side moves on.
  /// Returns where the right side begins.
  size_t partition(const Range& r, const BinMap& map, const Split& split) {
    Ref *left = refs + r.begin, *right = scratch + r.begin;
    for (const Ref *p = left, *end = refs + r.end; p != end; ++p) {
      const Ref ref = *p;
      const bool is_left = map.below(ref, split.axis, split.bin);
      *left = ref;
      *right = ref;
      left += is_left;
      right += !is_left;
    }
    std::copy(scratch + r.begin, right, left);
    return size_t(left - refs);
  }
  static size_t weigh(const Ref* first, const Ref* last) {
    size_t sum = 0;
    for (; first != last; ++first) sum += Weight::weight(*first);
    return sum;
  }
  /// Halves a range at the median centroid of its longest axis; by position when all centroids are
  /// one.
  void split_median(const Range& r, const Box& centroids, Range& a, Range& b) {
    const F4 e = centroids.hi - centroids.lo;
    const int axis = e[0] >= e[1] && e[0] >= e[2] ? 0 : e[1] >= e[2] ? 1 : 2;
    Ref *first = refs + r.begin, *last = refs + r.end, *middle = first + r.count() / 2;
    auto before = [axis](const Ref& p, const Ref& q) {
      const float x = centroid(p)[axis], y = centroid(q)[axis];
      return x != y                 ? x < y
             : p.source != q.source ? p.source < q.source
                                    : p.primitive < q.primitive;
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
    if (r.count() == 2 && r.weight > options.max_leaf) {
      split_at(r, r.begin + 1, a, b);
      return true;
    }
    const Box centroids = centroid_box(refs + r.begin, refs + r.end);
    const BinMap map(centroids, r.count());
    Split best;
    if (depth < kMedianDepth) {
      bins.fill<Weight>(refs + r.begin, refs + r.end, map);
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

/// A range of refs whose nodes are still to be made, and the place in the top nodes where they
/// belong.
struct Task {
  size_t node;
  int lane;
  int depth;
  Range range;
};

/// Appends the nodes over a range to `nodes`. Children that weigh `sah_threshold` or less are not
/// opened further: leaf(range, node, lane, depth) gives what they refer to.
template <class Weight, class Leaf>
struct NodeMaker {
  Splitter<Weight> splitter;
  std::vector<Node>& nodes;
  const std::atomic<bool>& cancel;
  size_t sah_threshold;
  Leaf leaf;

  ChildRef make(const Range& r, int depth) {
    if (cancel.load(std::memory_order_relaxed)) throw Cancelled{};
    Range children[kWidth];
    const int count = open(r, depth, children);
    const size_t index = nodes.size();
    nodes.emplace_back();
    for (int k = 0; k < kWidth; ++k)
      set_child(nodes[index], k, k < count ? &children[k].box : nullptr);
    for (int k = 0; k < count; ++k) {
      const bool small = children[k].count() == 1 || children[k].weight <= sah_threshold;
      const ChildRef child =
          small ? leaf(children[k], index, k, depth + 1) : make(children[k], depth + 1);
      nodes[index].child[k] = child;
    }
    return ChildRef(index);
  }

  /// Splits the child with the largest box until there are eight or none is worth it.
  int open(const Range& r, int depth, Range* children) {
    const BuildOptions& options = splitter.options;
    const size_t shut =
        r.weight > kWidth ? std::max(options.min_leaf, options.min_node) : options.min_leaf;
    double area[kWidth] = {half_area(r.box)};
    int count = 1;
    children[0] = r;
    for (int k; count < kWidth && (k = largest(children, area, count, shut)) >= 0;) {
      Range a, b;
      if (!splitter.split(children[k], depth, a, b)) {
        area[k] = -1;
        continue;
      }
      children[k] = a;
      children[count] = b;
      area[k] = half_area(a.box);
      area[count] = half_area(b.box);
      ++count;
    }
    return count;
  }

  int largest(const Range* children, const double* area, int count, size_t shut) const {
    int best = -1;
    for (int k = 0; k < count; ++k) {
      if (area[k] < 0 || children[k].count() == 1 || children[k].weight <= shut) continue;
      if (best < 0 || area[k] > area[best] ||
          (area[k] == area[best] && children[k].weight > children[best].weight))
        best = k;
    }
    return best;
  }
};

/// The work on one tree: top nodes over clusters, then the nodes below them by all threads.
class TreeMaker {
 public:
  TreeMaker(Ref* refs, size_t count, const BuildOptions& options, ThreadPool& pool,
            const std::atomic<bool>& cancel)
      : refs_(refs), scratch_(count), options_(options), pool_(pool), cancel_(cancel) {}

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

  void add(const Task& task) {
    (task.range.weight > kBig && task.depth < kMedianDepth ? big_ : small_).push_back(task);
  }
  void place(const Task& task, ChildRef child) {
    (task.node == kNoNode ? root_ : top_[task.node].child[task.lane]) = child;
  }

  /// The top nodes over a range, and tasks for what is below. A range that the grid cannot part is
  /// left to one thread.
  void part(const Task& task) {
    std::vector<Task> found;
    const BuildOptions over{1, 1, 0, kCluster, kTask, false};
    const ChildRef root = over_clusters(task, over, pool_, top_, found);
    if (found.size() == 1 && found[0].node == kNoNode) return small_.push_back(task);
    place(task, root);
    for (const Task& t : found) add(t);
  }

  /// Makes the nodes over the clusters of a range; `found` are the ranges whose nodes are still to
  /// be made, the task itself when there are no clusters.
  ChildRef over_clusters(const Task& task, const BuildOptions& options, ThreadPool& pool,
                         std::vector<Node>& nodes, std::vector<Task>& found) {
    std::vector<Ref> clusters = make_clusters(refs_, scratch_.data.get(), task.range,
                                              options.cluster, pool),
                     spare(clusters.size());
    if (clusters.size() == 1) {
      found.push_back({kNoNode, 0, task.depth, task.range});
      return 0;
    }
    const auto later = [&](const Range& r, size_t node, int lane, int depth) {
      if (r.weight <= options.max_leaf) return leaf_ref(r.first, r.weight);
      found.push_back({node, lane, depth, {r.first, r.first + r.weight, r.first, r.weight, r.box}});
      return ChildRef(0);
    };
    NodeMaker<Cluster, decltype(later)> maker{
        {clusters.data(), spare.data(), options, {}}, nodes, cancel_, options.sah_threshold, later};
    const ChildRef root = maker.make(
        {0, clusters.size(), task.range.first, task.range.weight, task.range.box}, task.depth);
    gather_clusters(refs_, scratch_.data.get(), task.range.first, clusters, pool);
    return root;
  }

  void make_batches() {
    size_t total = 0, open = 0;
    for (const Task& t : small_) total += t.range.weight;
    for (size_t k = 0; k < small_.size(); ++k) {
      if (open == 0) batches_.push_back({k, k, {}, {}});
      open += small_[k].range.weight;
      batches_.back().last = k + 1;
      if (open > total / 64) open = 0;
    }
    pool_.run(batches_.size(), [&](size_t k) { fill(batches_[k]); });
    scratch_ = {};
  }

  void fill(Batch& batch) {
    ThreadPool alone(1);
    for (size_t k = batch.first; k < batch.last; ++k)
      batch.roots.push_back(below(small_[k], alone, batch.nodes));
  }

  /// All nodes of a task.
  ChildRef below(const Task& task, ThreadPool& alone, std::vector<Node>& nodes) {
    if (task.range.weight <= options_.max_leaf)
      return leaf_ref(task.range.first, task.range.weight);
    if (options_.halve && task.node != kNoNode && task.depth < kMedianDepth)
      return over_cells(task, alone, nodes);
    if (task.range.weight <= options_.sah_threshold || task.depth >= kMedianDepth)
      return over_refs(task, nodes);
    std::vector<Task> found;
    ChildRef root = over_clusters(task, options_, alone, nodes, found);
    for (const Task& t : found)
      (t.node == kNoNode ? root : nodes[t.node].child[t.lane]) = over_refs(t, nodes);
    return root;
  }
  ChildRef over_cells(const Task& task, ThreadPool& alone, std::vector<Node>& nodes) {
    if (cancel_.load(std::memory_order_relaxed)) throw Cancelled{};
    const std::vector<size_t> start =
        sort_into_cells(refs_, scratch_.data.get(), task.range, (options_.max_leaf + 1) / 2, alone);
    return halve_cells(refs_, start, options_, nodes);
  }
  ChildRef over_refs(const Task& task, std::vector<Node>& nodes) {
    const auto leaf = [](const Range& r, size_t, int, int) { return leaf_ref(r.first, r.weight); };
    NodeMaker<Single, decltype(leaf)> maker{
        {refs_, scratch_.data.get(), options_, {}}, nodes, cancel_, options_.max_leaf, leaf};
    return maker.make(task.range, task.depth);
  }

  /// Puts the nodes of the batches behind the top nodes.
  NodeTree join() {
    std::vector<size_t> base(batches_.size() + 1, top_.size());
    for (size_t k = 0; k < batches_.size(); ++k) base[k + 1] = base[k] + batches_[k].nodes.size();
    auto moved = [&](ChildRef c, size_t k) { return c & kLeaf ? c : ChildRef(c + base[k]); };
    for (size_t k = 0; k < batches_.size(); ++k)
      for (size_t t = batches_[k].first; t < batches_[k].last; ++t)
        place(small_[t], moved(batches_[k].roots[t - batches_[k].first], k));
    NodeTree tree{Buffer<Node>(base.back()), root_, {}};
    std::copy(top_.begin(), top_.end(), tree.nodes.data.get());
    pool_.run(batches_.size(), [&](size_t k) {
      move_nodes(batches_[k].nodes, tree.nodes.data.get() + base[k],
                 [&](ChildRef c) { return moved(c, k); });
      std::vector<Node>().swap(batches_[k].nodes);
    });
    return tree;
  }

  Ref* refs_;
  Buffer<Ref> scratch_;
  BuildOptions options_;
  ThreadPool& pool_;
  const std::atomic<bool>& cancel_;
  std::vector<Node> top_;
  ChildRef root_ = 0;
  std::vector<Task> big_, small_;
  std::vector<Batch> batches_;
};

}  // namespace

NodeTree build_nodes(Ref* refs, size_t count, const BuildOptions& options, ThreadPool& pool,
                     const std::atomic<bool>& cancel) {
  if (count > size_t(kOrdinal)) throw std::bad_alloc();
  const size_t parts = 1 + count / kBig;
  std::vector<Box> part(parts);
  pool.run(parts, [&](size_t k) {
    part[k] = ref_box(refs + count * k / parts, refs + count * (k + 1) / parts);
  });
  Range all{0, count, 0, count, {}};
  for (const Box& b : part) all.box.add(b);
  return TreeMaker(refs, count, options, pool, cancel).make(all);
}

}  // namespace glint
