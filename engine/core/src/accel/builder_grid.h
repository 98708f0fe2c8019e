// Many boxes into clusters of neighbours: one pass over a grid instead of ten levels of halving.
#pragma once
#include <atomic>
#include <vector>

#include "builder_split.h"
#include "team.h"

namespace glint {

/// Copies the refs of a range, at least two, to scratch so that those of a cell of the grid lie together, and returns the clusters: boxes
/// whose `primitive` is the place of the cluster's first ref in scratch and whose `source` is how many there are. Cells hold refs of about
/// their own size or smaller, so that a large box does not swell a cluster of small ones; the largest refs are clusters of their own. The same
/// for every team. When the grid cannot part the refs there is one cluster.
std::vector<Ref> make_clusters(const Ref* refs, Ref* scratch, const Range& range, Team& team);

/// Copies the refs of the clusters back, from `begin` on and cluster by cluster; at[c] is where those of cluster c begin now.
std::vector<size_t> gather_clusters(Ref* refs, const Ref* scratch, size_t begin, const std::vector<Ref>& clusters, Team& team);

}  // namespace glint
