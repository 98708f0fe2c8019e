// From boxes to a tree of eight children a node: always the largest child is split, by the surface
// area heuristic (builder_split.h). Many boxes are first gathered into clusters (builder_grid.h);
// the upper nodes are made over those. Where only time counts, the nodes below halve a grid's cells
// instead (morton_grid.h).
#pragma once
#include <atomic>
#include <memory>
#include <vector>

#include "bvh/bounds.h"
#include "bvh/bvh.h"
#include "system/page_allocator.h"
#include "system/thread_pool.h"

namespace glint {

/// Thrown inside a build when the caller's flag became true.
struct Cancelled {};

struct BuildOptions {
  uint32_t max_leaf = 8;  // at most this many primitives a leaf
  uint32_t min_leaf = 4;  // children with more are split while their node has room
  uint32_t min_node =
      0;  // children with no more become a node of their own where theirs has more than eight refs
  uint32_t cluster = 8;          // refs a cluster, where nodes are made over few refs
  uint32_t sah_threshold = 512;  // refs: nodes over fewer are made over those themselves
  bool halve = false;  // nodes over few refs halve the cells of a grid, whatever that costs a ray
};

/// Memory that is not cleared first, for plain data.
template <class T>
struct Buffer {
  struct Release {
    size_t bytes = 0;
    void operator()(T* memory) const noexcept { give_memory(memory, bytes); }
  };
  std::unique_ptr<T[], Release> data;
  size_t size = 0;
  Buffer() = default;
  explicit Buffer(size_t n)
      : data(static_cast<T*>(take_memory(n * sizeof(T))), Release{n * sizeof(T)}), size(n) {}
  T& operator[](size_t k) { return data[k]; }
  const T& operator[](size_t k) const { return data[k]; }
  size_t bytes() const { return size * sizeof(T); }
};

struct NodeTree {
  Buffer<Node> nodes;
  ChildRef root = 0;
  Box box;
};

/// Sorts refs[0, count), count >= 1, into the order of the leaves and returns the nodes above. The
/// same for every pool. Throws Cancelled, and std::bad_alloc also when count does not fit a
/// ChildRef.
NodeTree build_nodes(Ref* refs, size_t count, const BuildOptions& options, ThreadPool& pool,
                     const std::atomic<bool>& cancel);

}  // namespace glint
