// Memory for the big arrays of a build and of a film. Large blocks come straight from the system
// and go straight back: a heap keeps what is freed in its middle, and a frame's trees would stay
// resident long after the frame.
#pragma once
#include <cstddef>

namespace glint {

/// `bytes` of memory that is not cleared, aligned for a Node. Throws std::bad_alloc.
void* take_memory(size_t bytes);

/// Gives back what `take_memory(bytes)` gave.
void give_memory(void* memory, size_t bytes) noexcept;

/// The same for memory that is 0. Pages that nobody touches cost nothing.
void* allocate_zeroed(size_t bytes);
void free_zeroed(void* memory, size_t bytes) noexcept;

}  // namespace glint
