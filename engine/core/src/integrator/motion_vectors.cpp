// Letters: m world_from_object, p a point in object space, c one along the camera's axes.
#include "integrator/motion_vectors.h"

#include <cmath>

#include "shading/panorama.h"

namespace glint {
namespace {

struct Pixel {
  double x, y;
  bool seen;
};

/// v with m v = p, where directions alone count; not finite where m has no inverse.
Vec3d solve(const Affine& m, Vec3d p) {
  const Vec3d x = cross(m.y, m.z), y = cross(m.z, m.x), z = cross(m.x, m.y);
  return (1 / dot(m.x, x)) * Vec3d{dot(x, p), dot(y, p), dot(z, p)};
}

/// Where a point of the world is in the picture of a camera, beyond its frame too.
Pixel pixel_of(const GlintCamera& camera, Vec3d world) {
  const Affine m = affine(camera.world_from_camera);
  Vec3d c = solve(m, world - m.t);
  bool seen = true;
  if (camera.kind == GLINT_PERSPECTIVE) {
    seen = c.z < 0;
    c = {c.x / -c.z, c.y / -c.z, 0};
  } else if (camera.kind == GLINT_PANORAMA) {
    c = unit(c);
    const PicturePoint point = picture_point(camera, {splat(c.x), splat(c.y), splat(c.z)});
    c = {point.u[0], point.v[0], 0};
  }
  const double* w = camera.window;
  return {(c.x - w[0]) / (w[1] - w[0]) * camera.width, (c.y - w[2]) / (w[3] - w[2]) * camera.height,
          seen};
}

/// Pixels of a whole turn in a picture that goes round; 0 for all others.
double turn_of(const GlintCamera& camera) {
  const bool round =
      camera.kind == GLINT_PANORAMA && (camera.projection == GLINT_EQUIRECTANGULAR ||
                                        camera.projection == GLINT_CENTRAL_CYLINDRICAL);
  if (!round) return 0;
  return 6.28318530717958647693 / (camera.longitude[1] - camera.longitude[0]) /
         (camera.window[1] - camera.window[0]) * camera.width;
}

void step(const Pixel& from, const Pixel& to, double turn, double* motion) {
  const bool seen = from.seen && to.seen;
  double x = from.x - to.x;
  if (turn != 0) x -= turn * std::floor(x / turn + 0.5);  // the shorter way round
  motion[0] = seen ? x : 0;
  motion[1] = seen ? from.y - to.y : 0;
}

/// The point of a triangle in object space.
Vec3d on_triangle(const Surface& s, const uint32_t* corners, const float* vertices) {
  Vec3d p;
  for (int k = 0; k < 3; ++k) {
    const float* v = vertices + 3 * size_t(corners[k]);
    p += s.weights[k] * Vec3d{v[0], v[1], v[2]};
  }
  return p;
}

/// How far a point of a sphere or a segment went in object space: as its centre, or as those of the
/// two spheres that its hull lies between.
Vec3d shift(const Surface& s, const GlintGeometry& geometry, const float* there) {
  const bool strand = geometry.kind == GLINT_STRANDS;
  const size_t first = strand ? geometry.indices[s.primitive] : s.primitive;
  Vec3d moved;
  for (size_t k = 0; k < (strand ? 2 : 1); ++k) {
    const float *a = geometry.vertices + 3 * (first + k), *b = there + 3 * (first + k);
    const Vec3d way{double(b[0]) - a[0], double(b[1]) - a[1], double(b[2]) - a[2]};
    moved += (strand ? s.weights[int(k)] : 1.0) * way;
  }
  return moved;
}

}  // namespace

void MotionVectors::at(const Surface& s, double (&motion)[4]) const {
  const GlintInstances& group = scene_.instances.group(s.instance);
  const GlintGeometry& geometry = scene_.instances.geometry(group);
  const uint32_t row = scene_.instances.placements[s.instance].row;
  const Affine m = affine(scene_.instances.matrix_row(row));
  const bool is_mesh = geometry.kind == GLINT_MESH;
  const uint32_t* const corners = is_mesh ? geometry.triangles + 3 * size_t(s.primitive) : nullptr;
  const Vec3d p = is_mesh ? on_triangle(s, corners, geometry.vertices)
                          : solve(m, scene_.anchor.world(s.x) - m.t);
  std::fill_n(motion, 4, 0.0);
  if (!finite(p)) return;
  const Pixel here = pixel_of(scene_.camera, point(m, p));
  const double turn = turn_of(scene_.camera);
  for (int k = 0; k < 2; ++k) {
    const GlintNeighbour& other = neighbours_[k];
    const float* const vertices = other.shapes[group.geometry].vertices;
    const Vec3d there = !vertices ? p
                        : is_mesh ? on_triangle(s, corners, vertices)
                                  : p + shift(s, geometry, vertices);
    const Affine moved = affine(other.world_from_object + 12 * size_t(row));
    const Pixel found = pixel_of(other.camera, point(moved, there));
    if (k == 0) step(found, here, turn, motion);
    else step(here, found, turn, motion + 2);
  }
}

}  // namespace glint
