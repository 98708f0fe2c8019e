// The trees in memory, as the kernels read them. Plain data only: nothing here may emit code,
// because the kernels are compiled for instruction sets that the machine at hand need not have.
#pragma once
#include <cstddef>
#include <cstdint>

namespace glint {

constexpr int kWidth = 8;      // children of a node
constexpr int kMaxLeaf = 8;    // primitives of a leaf, as far as ChildRef can say
constexpr int kMaxDepth = 72;  // of nodes; the builder keeps to it
constexpr int kStack = kMaxDepth * (kWidth - 1) + kWidth;
constexpr int kInterleaved = 64;  // rays that are on their way each on its own: those of a tile
constexpr int kLeftParts = 128;   // parts of a tree that a tile's rays may leave for then
constexpr int kRayStack = kStack + kWidth + kLeftParts + 1;

/// A node's number, or kLeaf | (count - 1) << kCountShift | number of the leaf's first primitive.
using ChildRef = uint32_t;
constexpr ChildRef kLeaf = 0x80000000u;
constexpr int kCountShift = 28;
constexpr ChildRef kOrdinal = (1u << kCountShift) - 1;

/// Boxes of eight children, plane by plane: lower x, upper x, lower y, upper y, lower z, upper z.
/// The planes of an absent child are +inf below and -inf above, so that no ray enters it.
/// A turned node has its boxes along axes of its own: a place x, y, z is at x turn[0] + y turn[1] +
/// z turn[2] there, lane by lane; the fourth is 0. So it is in trees of strands alone.
struct alignas(64) Node {
  float planes[6][kWidth];
  ChildRef child[kWidth];
  int16_t turn[3][4];
  uint32_t turned;  // 0 or 1
};

enum LeafKind : uint32_t { kTriangleLeaf, kSphereLeaf, kPolygonLeaf, kInstanceLeaf, kStrandLeaf };

/// Instance and primitive as Hit counts them. Trees in object space leave `instance` at 0.
struct PrimitiveId {
  uint32_t instance, primitive;
};

/// The plane of a polygon through `p` with Newell's normal `n`, and the two axes of its projection.
struct PolygonRecord {
  double n[3], p[3];
  size_t first;  // of its corners, in TreeView::corners
  uint32_t count, axis_u, axis_v;
};

struct InstanceRecord {
  double linear[9], origin[3];  // object = linear (world - origin), by columns
  uint32_t tree, instance, visibility;
};

/// The caller's arrays of a geometry of strands.
struct StrandArrays {
  const float *vertices, *radii;  // 3 and 1 a vertex
  const uint32_t* starts;         // the vertex where each segment begins; it ends at the next one
};

/// Primitives are numbered in the order of the leaves; a leaf with n primitives from `first` on
/// reads
///   triangles: 9 n floats at 9 first: x, y, z of the first vertices, of the second, of the third,
///   n floats each; spheres: 4 floats each at 4 first: centre and radius;  polygons: records;
///   instances: records; strands: nothing but their ids, with the vertex where each begins in the
///   place of the instance; the rest is where the caller has it.
struct TreeView {
  const Node* nodes;
  const float* floats;
  const PrimitiveId* ids;
  const PolygonRecord* polygons;
  const float* corners;
  StrandArrays strands;
  double center[3], radius;  // a ball round everything, with room to spare
  double ball;               // radius of the smallest one there, with room for rounding
  ChildRef root;
  LeafKind kind;
  bool large;  // more than the caches next to a processor hold beside other things
  bool turns;  // some nodes are turned
};

/// What each of the rays that go one by one has yet to visit, in a tree over instances and in
/// another one. Too large for the stack that some systems give a thread (musl 128 KB, macOS 512
/// KB).
struct RayStacks {
  int64_t placed[kInterleaved][kRayStack], own[kInterleaved][kRayStack];
};

/// `trees`: those in world space, one a kind at most. `objects`: those that instances refer to.
/// `visibility`: of every instance.
struct TopLevelView {
  const TreeView* trees;
  size_t tree_count;
  const TreeView* objects;
  const InstanceRecord* instances;
  const uint32_t* visibility;
  uint32_t common_visibility;  // what all of them have
};

}  // namespace glint
