// All shapes of lights.
#pragma once
#include "shading/light/area.h"
#include "shading/light/dome.h"
#include "shading/light/point.h"
#include "shading/light/points.h"
#include "shading/light/sun.h"

namespace glint {
namespace {

template <class... Shapes>
struct ShapeList {};

template <class... Shapes, class... More>
constexpr ShapeList<Shapes..., More...> operator+(ShapeList<Shapes...>, ShapeList<More...>) {
  return {};
}

/// Shapes of lamps that lobes draw directions to; of all that may share shadow rays; of all that
/// lobes draw directions to without rays that find the light; of what media see; and all.
constexpr ShapeList<Sun, Sphere, Disc, Area, SolidRectangle> kDrawnLamps;
constexpr auto kSharing = kDrawnLamps + ShapeList<Point, MediumPoint>();
constexpr auto kDrawn = kDrawnLamps + ShapeList<Dome, OpenDome>();
constexpr auto kScattered = kSharing + ShapeList<Dome, MeshPoint>();
constexpr auto kShapes = kScattered + ShapeList<OpenDome>();

/// of<Shape>() for the one of the shapes that it is.
template <class... Shapes, class Of>
void with_shape(ShapeList<Shapes...>, LightShape shape, Of of) {
  static_cast<void>(((shape == Shapes::kShape && (of.template operator()<Shapes>(), true)) || ...));
}

}  // namespace
}  // namespace glint
