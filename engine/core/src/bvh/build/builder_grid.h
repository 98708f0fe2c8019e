// Many boxes into clusters of neighbours: one pass over a grid instead of ten levels of halving.
#pragma once
#include <atomic>
#include <vector>

#include "bvh/build/builder_split.h"
#include "system/thread_pool.h"

namespace glint {

/// Copies the refs of a range, at least two, to scratch so that those of a cell of the grid lie
/// together, and returns the clusters: boxes whose `primitive` is the place of the cluster's first
/// ref in scratch and whose `source` is how many there are. Neighbouring cells are joined up to
/// `limit` refs. Cells hold refs of about their own size or smaller, so that a large box does not
/// swell a cluster of small ones; the largest refs are clusters of their own. The same for every
/// pool. When the grid cannot part the refs there is one cluster.
std::vector<Ref> make_clusters(const Ref* refs, Ref* scratch, const Range& range, size_t limit,
                               ThreadPool& pool);

/// Sorts the refs of a range, at least two, into the cells of a grid, as many as are wanted for
/// `limit` refs a cell. Returns where cell c begins, and the end of the range last. A power of two
/// of cells: halving their numbers halves a box.
std::vector<size_t> sort_into_cells(Ref* refs, Ref* scratch, const Range& range, size_t limit,
                                    ThreadPool& pool);

/// Copies the refs of the clusters back, from `begin` on and cluster by cluster.
void gather_clusters(Ref* refs, const Ref* scratch, size_t begin, const std::vector<Ref>& clusters,
                     ThreadPool& pool);

}  // namespace glint
