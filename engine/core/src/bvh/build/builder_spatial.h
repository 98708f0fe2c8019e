// Trees whose nodes may share triangles: where boxes would overlap, space is parted and the
// triangles that lie across are cut.
#pragma once
#include <functional>

#include "bvh/build/builder.h"

namespace glint {

/// The corners of the triangle that a ref stands for.
using CornersOf = std::function<void(const Ref&, Vec3d (&)[3])>;

/// As build_nodes, over triangles, with spatial splits (Stich, Friedrich, Dietrich 2009, Spatial
/// Splits in Bounding Volume Hierarchies): a triangle may be in several leaves, whose boxes
/// together hold all of it. `refs` become those of the leaves in their order, at most half as many
/// more; their boxes are what is left of the triangles there. The same for every pool.
NodeTree build_spatial(Buffer<Ref>& refs, const CornersOf& corners, const BuildOptions& options,
                       ThreadPool& pool, const std::atomic<bool>& cancel);

}  // namespace glint
