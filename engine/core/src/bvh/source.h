// From the caller's arrays to primitives of a tree: which ones there are, their boxes, and what the
// leaves hold of them.
#pragma once
#include <vector>

#include "bvh/accel.h"
#include "bvh/build/builder.h"

namespace glint {

/// A geometry on its way into a tree. Its vertices are in the space of that tree: `vertices` are
/// the caller's, or `baked` to world space.
struct Source {
  const GeometryView* geometry;
  uint32_t instance;    // 0 in object space
  const Affine* bake;   // null: leave the vertices where they are
  double radius_scale;  // spheres
  const float* vertices = nullptr;
  Buffer<float> baked;
};

/// One tree with all that it owns.
struct Tree {
  LeafKind kind = kTriangleLeaf;
  NodeTree nodes;
  Buffer<float> floats;
  StrandArrays strands{};  // the caller's: a tree of strands is of one geometry, in its space
  Buffer<PrimitiveId> ids;
  Buffer<PolygonRecord> polygons;
  std::vector<float> corners;
  std::vector<uint32_t> order;  // kInstanceLeaf: the numbers of the refs in the order of the leaves
  size_t count = 0;  // what the leaves hold: primitives, some of them perhaps more than once
  size_t primitives = 0, dropped = 0;
  double ball =
      0;  // radius of a ball round the middle of the box that holds everything, to float precision
  bool turns = false;  // some nodes are turned
  bool parts = false;  // leaves may hold parts of triangles: then only all leaves of a triangle
                       // together hold it

  TreeView view() const;
  size_t bytes() const;
};

/// Makes the tree over all sources, which are of one kind. Primitives with a non-finite
/// vertex, an index out of range or no extent are dropped and counted: triangles with two corners
/// in one point, polygons without area, spheres without radius. Triangles whose corners lie on a
/// line are counted too, but stay. A tree without primitives has count 0.
Tree make_tree(std::vector<Source>& sources, BuildQuality quality, ThreadPool& pool,
               const std::atomic<bool>& cancel);

/// Makes the tree over boxes alone; `order` tells where they went.
Tree make_instance_tree(std::vector<Ref> boxes, ThreadPool& pool, const std::atomic<bool>& cancel);

/// A tree over instances and up to kWidth - 1 boxes that go beside it, one more node. Their numbers
/// follow those in the tree.
Tree with_beside(const Tree& tree, const std::vector<Ref>& boxes);

/// Newell's normal, centre and projection of a polygon; false when it has no area or a non-finite
/// corner. `box` receives the part of its plane that it covers.
bool make_polygon(const Source& source, size_t primitive, PolygonRecord& record, BoxD& box);

}  // namespace glint
