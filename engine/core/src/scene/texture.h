// Images as the stages read them, with the tables of their codes.
#pragma once
#include "glint.h"
#include "shading/stages.h"

namespace glint {

TextureShape shape_of(const GlintTexture& texture);

}  // namespace glint
