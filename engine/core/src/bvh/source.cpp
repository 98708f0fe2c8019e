#include "bvh/source.h"

#include <algorithm>
#include <cstring>

#include "bvh/build/builder_nodes.h"
#include "bvh/build/builder_spatial.h"
#include "bvh/build/turned_nodes.h"
#include "bvh/outline.h"

namespace glint {
namespace {

constexpr size_t kChunk = 16384;

/// A part of a source's vertices or primitives.
struct Piece {
  size_t source, first, last, out = 0, kept = 0, unseen = 0;
};

template <class Count>
std::vector<Piece> pieces(const std::vector<Source>& sources, Count count) {
  std::vector<Piece> list;
  size_t out = 0;
  for (size_t s = 0; s < sources.size(); ++s)
    for (size_t first = 0, n = count(sources[s]); first < n; first += kChunk) {
      list.push_back({s, first, std::min(n, first + kChunk), out});
      out += list.back().last - first;
    }
  return list;
}

void bake_vertices(std::vector<Source>& sources, ThreadPool& pool) {
  for (Source& s : sources) {
    if (s.bake) s.baked = Buffer<float>(3 * s.geometry->vertex_count);
    s.vertices = s.bake ? s.baked.data.get() : s.geometry->vertices;
  }
  std::vector<Piece> list =
      pieces(sources, [](const Source& s) { return s.bake ? s.geometry->vertex_count : 0; });
  pool.run(list.size(), [&](size_t k) {
    Source& s = sources[list[k].source];
    for (size_t v = list[k].first; v < list[k].last; ++v) {
      const float* p = s.geometry->vertices + 3 * v;
      const Vec3f q(point(*s.bake, Vec3d(p[0], p[1], p[2])));
      std::memcpy(&s.baked[3 * v], &q, sizeof q);
    }
  });
}

Vec3f vertex(const Source& s, size_t index) {
  return {s.vertices[3 * index], s.vertices[3 * index + 1], s.vertices[3 * index + 2]};
}
F4 f4(Vec3f p) { return F4{p.x, p.y, p.z, 0}; }
/// Whether two corners are one: the neighbours of such a triangle share an edge without it. (One
/// that is squeezed to a line between three corners stays: without it a corner of one neighbour
/// would lie within an edge of another, and rays would slip through there.)
bool pinched(F4 a, F4 b, F4 c) { return !any(a != b) || !any(b != c) || !any(c != a); }

/// Whether the area is exactly 0, for coordinates that are floats: nothing of it is ever seen.
bool flat(F4 a, F4 b, F4 c) {
  const Vec3d p(a[0], a[1], a[2]), u = Vec3d(b[0], b[1], b[2]) - p, v = Vec3d(c[0], c[1], c[2]) - p;
  return u.y * v.z == u.z * v.y && u.z * v.x == u.x * v.z && u.x * v.y == u.y * v.x;
}

bool triangle_ref(const Source& s, size_t primitive, uint32_t number, Ref& ref, bool& seen) {
  const uint32_t* index = s.geometry->triangles + 3 * primitive;
  if (std::max({index[0], index[1], index[2]}) >= s.geometry->vertex_count) return false;
  const F4 a = f4(vertex(s, index[0])), b = f4(vertex(s, index[1])), c = f4(vertex(s, index[2]));
  const F4 none = (a - a) + (b - b) + (c - c);  // 0, or NaN where a coordinate is not finite
  if (any(none != F4{}) || pinched(a, b, c)) return false;
  seen = !flat(a, b, c);
  ref = make_ref(Box{lower(a, lower(b, c)), upper(a, upper(b, c))}, uint32_t(primitive), number);
  return true;
}

/// With room for where double puts hits on what is not made of triangles.
Ref padded_ref(BoxD box, uint32_t primitive, uint32_t number) {
  const double far = std::max(max_abs(box.lo), max_abs(box.hi)), margin = 0x1p-48 * far;
  box.lo = box.lo - Vec3d{margin, margin, margin};
  box.hi = box.hi + Vec3d{margin, margin, margin};
  return make_ref(box, primitive, number);
}

bool sphere_ref(const Source& s, size_t primitive, uint32_t number, Ref& ref) {
  const Vec3d c(vertex(s, primitive));
  const double r = double(float(s.geometry->radii[primitive] * s.radius_scale));
  if (!finite(c) || !(r > 0 && std::isfinite(r))) return false;
  BoxD box;
  box.add(c - Vec3d(r, r, r));
  box.add(c + Vec3d(r, r, r));
  ref = padded_ref(box, uint32_t(primitive), number);
  return true;
}

/// Both ends and their radii; false for what no ray meets.
bool strand_ends(const Source& s, size_t primitive, float (&out)[8]) {
  const size_t first = s.geometry->indices[primitive];
  if (first + 1 >= s.geometry->vertex_count) return false;
  for (size_t j = 0; j < 6; ++j) out[j] = s.vertices[3 * first + j];
  float none = 0, widest = 0;
  for (size_t j = 0; j < 2; ++j) {
    out[6 + j] = s.geometry->radii[first + j];
    if (!(out[6 + j] >= 0)) return false;
    widest = std::max(widest, out[6 + j]);
  }
  for (float x : out) none += x - x;  // NaN where one is not finite
  return none == 0 && widest > 0;
}

bool strand_ref(const Source& s, size_t primitive, uint32_t number, Ref& ref) {
  float ends[8];
  if (!strand_ends(s, primitive, ends)) return false;
  BoxD box;
  for (size_t j = 0; j < 2; ++j) {
    const Vec3d c(ends[3 * j], ends[3 * j + 1], ends[3 * j + 2]);
    const double r = ends[6 + j];
    box.add(c - Vec3d(r, r, r));
    box.add(c + Vec3d(r, r, r));
  }
  ref = padded_ref(box, uint32_t(primitive), number);
  return true;
}

bool polygon_ref(const Source& s, size_t primitive, uint32_t number, Ref& ref) {
  PolygonRecord record;
  BoxD box;
  if (!make_polygon(s, primitive, record, box)) return false;
  ref = padded_ref(box, uint32_t(primitive), number);
  return true;
}

/// False where there is nothing to put into a tree; `seen` becomes false where what is put there
/// has no area.
bool any_ref(const Source& s, size_t primitive, uint32_t number, Ref& ref, bool& seen) {
  switch (s.geometry->kind) {
    case GeometryView::kMesh: return triangle_ref(s, primitive, number, ref, seen);
    case GeometryView::kSpheres: return sphere_ref(s, primitive, number, ref);
    case GeometryView::kStrands: return strand_ref(s, primitive, number, ref);
    default: return polygon_ref(s, primitive, number, ref);
  }
}

/// The refs of all sound primitives, in the order of sources and primitives; `refs.size` of them.
/// `unseen`: how many have no area.
Buffer<Ref> collect(const std::vector<Source>& sources, ThreadPool& pool,
                    const std::atomic<bool>& cancel, size_t& unseen) {
  std::vector<Piece> list =
      pieces(sources, [](const Source& s) { return s.geometry->primitive_count; });
  Buffer<Ref> refs(list.empty() ? 0 : list.back().out + list.back().last - list.back().first);
  pool.run(list.size(), [&](size_t k) {
    if (cancel.load(std::memory_order_relaxed)) throw Cancelled{};
    Piece& piece = list[k];
    for (size_t p = piece.first; p < piece.last; ++p) {
      bool seen = true;
      piece.kept += any_ref(sources[piece.source], p, uint32_t(piece.source),
                            refs[piece.out + piece.kept], seen);
      piece.unseen += !seen;
    }
  });
  size_t kept = 0;
  for (const Piece& piece : list) {
    if (kept != piece.out) std::copy_n(&refs[piece.out], piece.kept, &refs[kept]);
    kept += piece.kept;
    unseen += piece.unseen;
  }
  refs.size = kept;
  return refs;
}

/// What the leaves need of the refs, a quarter of their size; `instance` is the number of the
/// source until `name_instances`.
Buffer<PrimitiveId> origins(const Buffer<Ref>& refs, ThreadPool& pool) {
  Buffer<PrimitiveId> ids(refs.size + kMaxLeaf);  // as of floats
  std::fill_n(ids.data.get() + refs.size, kMaxLeaf, PrimitiveId{});
  ids.size = refs.size;
  each_chunk(ids.size, kChunk, pool,
             [&](size_t k) { ids[k] = {refs[k].source, refs[k].primitive}; });
  return ids;
}

void name_instances(Buffer<PrimitiveId>& ids, const std::vector<Source>& sources,
                    ThreadPool& pool) {
  each_chunk(ids.size, kChunk, pool,
             [&](size_t k) { ids[k].instance = sources[ids[k].instance].instance; });
}

void fill_triangles(const std::vector<Source>& sources, const PrimitiveId* from, size_t count,
                    float* out) {
  for (size_t k = 0; k < count; ++k) {
    const Source& s = sources[from[k].instance];
    for (size_t j = 0; j < 3; ++j) {
      const Vec3f p = vertex(s, s.geometry->triangles[3 * size_t(from[k].primitive) + j]);
      for (size_t axis = 0; axis < 3; ++axis) out[(3 * j + axis) * count + k] = p[int(axis)];
    }
  }
}

void fill_spheres(const std::vector<Source>& sources, const PrimitiveId* from, size_t count,
                  float* out) {
  for (size_t k = 0; k < count; ++k, out += 4) {
    const Source& s = sources[from[k].instance];
    const Vec3f c = vertex(s, from[k].primitive);
    out[0] = c.x;
    out[1] = c.y;
    out[2] = c.z;
    out[3] = float(s.geometry->radii[from[k].primitive] * s.radius_scale);
  }
}

/// Calls fill(first, count) for every leaf.
template <class Fill>
void each_leaf(const NodeTree& tree, ThreadPool& pool, Fill fill) {
  auto visit = [&](ChildRef c) { fill(size_t(c & kOrdinal), size_t((c >> kCountShift & 7) + 1)); };
  if (tree.root & kLeaf) return visit(tree.root);
  const size_t each = 1024;
  pool.run((tree.nodes.size + each - 1) / each, [&](size_t k) {
    for (size_t n = k * each; n < std::min(tree.nodes.size, (k + 1) * each); ++n)
      for (ChildRef c : tree.nodes[n].child)
        if (c & kLeaf) visit(c);
  });
}

void fill_polygons(Tree& tree, const std::vector<Source>& sources, const PrimitiveId* from) {
  tree.polygons = Buffer<PolygonRecord>(tree.count);
  for (size_t k = 0; k < tree.count; ++k) {
    const Source& s = sources[from[k].instance];
    BoxD box;
    make_polygon(s, from[k].primitive, tree.polygons[k], box);
    tree.polygons[k].first = tree.corners.size() / 3;
    for (size_t c = s.geometry->offsets[from[k].primitive];
         c < s.geometry->offsets[from[k].primitive + 1]; ++c) {
      const Vec3f p = vertex(s, s.geometry->indices[c]);
      tree.corners.insert(tree.corners.end(), {p.x, p.y, p.z});
    }
  }
}

void fill_leaves(Tree& tree, const std::vector<Source>& sources, ThreadPool& pool) {
  const PrimitiveId* from = tree.ids.data.get();
  if (tree.kind == kPolygonLeaf) return fill_polygons(tree, sources, from);
  if (tree.kind == kStrandLeaf) {
    const GeometryView& g = *sources.front().geometry;
    tree.strands = {g.vertices, g.radii, g.indices};
    return;
  }
  const size_t stride = tree.kind == kTriangleLeaf ? 9 : 4;
  tree.floats =
      Buffer<float>(stride * tree.count + kWidth);  // vector loads read beyond the last leaf
  std::fill_n(tree.floats.data.get() + stride * tree.count, kWidth, 0.0f);
  each_leaf(tree.nodes, pool, [&](size_t first, size_t count) {
    float* out = tree.floats.data.get() + stride * first;
    if (tree.kind == kTriangleLeaf) fill_triangles(sources, from + first, count, out);
    if (tree.kind == kSphereLeaf) fill_spheres(sources, from + first, count, out);
  });
}

LeafKind axis_class_of(const GeometryView& g) {
  return g.kind == GeometryView::kMesh      ? kTriangleLeaf
         : g.kind == GeometryView::kSpheres ? kSphereLeaf
         : g.kind == GeometryView::kStrands ? kStrandLeaf
                                            : kPolygonLeaf;
}

constexpr size_t kLarge = size_t(1) << 19;  // bytes

BuildOptions options_of(LeafKind kind, BuildQuality quality) {
  BuildOptions options;
  if (kind == kStrandLeaf) {
    options.max_leaf = 4;
    options.min_leaf = 1;
  } else if (kind == kSphereLeaf) {
    options.max_leaf = 2;
    options.min_leaf = 1;
  } else if (kind != kTriangleLeaf) options.max_leaf = options.min_leaf = 1;
  if (kind == kInstanceLeaf) options.min_node = kWidth;
  options.halve = quality == BuildQuality::kFast;
  return options;
}

void corners_of(const Source& s, size_t primitive, Vec3d (&p)[3]) {
  for (size_t j = 0; j < 3; ++j) p[j] = Vec3d(vertex(s, s.geometry->triangles[3 * primitive + j]));
}

Vec3d corner(const Source& s, size_t index) { return Vec3d(vertex(s, s.geometry->indices[index])); }

}  // namespace

bool make_polygon(const Source& s, size_t primitive, PolygonRecord& record, BoxD& box) {
  const size_t first = s.geometry->offsets[primitive], last = s.geometry->offsets[primitive + 1],
               count = last - first;
  if (last < first + 3) return false;
  for (size_t k = first; k < last; ++k)
    if (s.geometry->indices[k] >= s.geometry->vertex_count || !finite(corner(s, k))) return false;
  const Vec3d origin = corner(s, first);
  Vec3d n, sum;
  for (size_t k = first; k < last; ++k) {
    const Vec3d a = corner(s, k) - origin, b = corner(s, k + 1 < last ? k + 1 : first) - origin;
    n += cross(a, b);
    sum += a;
  }
  n = unit(n);
  if (!any(n)) return false;
  const Vec3d p = origin + sum * (1 / double(count)), size = abs(n);
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  record = {{n.x, n.y, n.z}, {p.x, p.y, p.z},          0,
            uint32_t(count), uint32_t((axis + 1) % 3), uint32_t((axis + 2) % 3)};
  for (size_t k = first; k < last; ++k) {
    Vec3d q = corner(s, k);
    q[axis] -= dot(n, q - p) / n[axis];  // onto the plane, along the axis of projection
    box.add(q);
  }
  return true;
}

Tree make_tree(std::vector<Source>& sources, BuildQuality quality, ThreadPool& pool,
               const std::atomic<bool>& cancel) {
  Tree tree;
  if (sources.empty()) return tree;
  tree.kind = axis_class_of(*sources.front().geometry);
  bake_vertices(sources, pool);
  Buffer<Ref> refs = collect(sources, pool, cancel, tree.dropped);
  for (const Source& s : sources) tree.dropped += s.geometry->primitive_count;
  tree.dropped -= tree.primitives = refs.size;
  if (tree.primitives == 0) return tree;
  const BuildOptions options = options_of(tree.kind, quality);
  if (tree.kind == kTriangleLeaf && quality == BuildQuality::kFine) {
    const auto corners = [&](const Ref& r, Vec3d(&p)[3]) {
      corners_of(sources[r.source], r.primitive, p);
    };
    tree.nodes = build_spatial(refs, corners, options, pool, cancel);
    tree.parts = true;
  } else {
    tree.nodes = build_nodes(refs.data.get(), refs.size, options, pool, cancel);
  }
  tree.count = refs.size;
  tree.ids = origins(refs, pool);
  refs = {};
  fill_leaves(tree, sources, pool);
  name_instances(tree.ids, sources, pool);
  if (tree.kind == kStrandLeaf)  // a look into memory less for every segment that a ray asks
    each_chunk(tree.count, kChunk, pool, [&](size_t k) {
      tree.ids[k].instance = tree.strands.starts[tree.ids[k].primitive];
    });
  tree.ball = ball_radius(tree);
  if (tree.kind == kStrandLeaf) tree.turns = turn_nodes(tree, pool);
  return tree;
}

Tree make_instance_tree(std::vector<Ref> boxes, ThreadPool& pool, const std::atomic<bool>& cancel) {
  Tree tree;
  tree.kind = kInstanceLeaf;
  tree.count = boxes.size();
  if (tree.count == 0) return tree;
  tree.nodes = build_nodes(boxes.data(), tree.count, options_of(tree.kind, BuildQuality::kBalanced),
                           pool, cancel);
  for (const Ref& r : boxes) tree.order.push_back(r.primitive);
  tree.ball = ball_radius(tree);
  return tree;
}

Tree with_beside(const Tree& tree, const std::vector<Ref>& boxes) {
  const size_t above = tree.nodes.nodes.size;
  Tree out;
  out.kind = kInstanceLeaf;
  out.count = tree.count + boxes.size();
  out.nodes = {Buffer<Node>(above + 1), ChildRef(above), tree.nodes.box};
  std::copy_n(tree.nodes.nodes.data.get(), above, out.nodes.nodes.data.get());
  Node& top = out.nodes.nodes[above];
  for (int lane = 0; lane < kWidth; ++lane)
    set_child(top, lane, lane == 0 ? &tree.nodes.box : nullptr);
  top.child[0] = tree.nodes.root;
  for (size_t k = 0; k < boxes.size(); ++k) {
    const Box box{xyz(low(boxes[k])), xyz(high(boxes[k]))};
    set_child(top, int(k) + 1, &box);
    top.child[k + 1] = leaf_ref(tree.count + k, 1);
    out.nodes.box.add(box);
  }
  out.ball = ball_radius(out);
  return out;
}

TreeView Tree::view() const {
  TreeView v{nodes.nodes.data.get(),
             floats.data.get(),
             ids.data.get(),
             polygons.data.get(),
             corners.data(),
             strands,
             {},
             0,
             0,
             nodes.root,
             kind,
             bytes() > kLarge,
             turns};
  double square = 0;
  for (int k = 0; k < 3; ++k) {
    const double lo = nodes.box.lo[k], hi = nodes.box.hi[k];
    v.center[k] = 0.5 * (lo + hi);
    square += (hi - lo) * (hi - lo);
  }
  v.radius = 0.51 * std::sqrt(square);
  const double reach =
      std::max({std::fabs(v.center[0]), std::fabs(v.center[1]), std::fabs(v.center[2])}) +
      5 * v.radius;
  v.ball = 1.001 * ball + 0x1p-18 * reach;
  return v;
}

size_t Tree::bytes() const {
  return nodes.nodes.bytes() + floats.bytes() + ids.bytes() + polygons.bytes() +
         corners.capacity() * sizeof(float) + order.capacity() * sizeof(uint32_t);
}

}  // namespace glint
