//! How much the machine has to do.

use crate::message::Message;
use crate::text::Sequence;

/// What the processors and the memory of the machine are used for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Message)]
#[repr(C)]
pub struct Load {
    /// The share of each processor that is at work, from 0 to 1.
    pub processors: Sequence<f32, 16>,
    /// Work of other processes (processors' worth).
    pub foreign: f32,
    /// Memory that this process uses (bytes).
    pub memory: f64,
    /// Memory that is free (bytes).
    pub memory_free: f64,
    /// The share of time in which somebody waited for a processor, from 0 to 1; 0 where the kernel does not tell.
    pub pressure_cpu: f32,
    /// The share of time in which somebody waited for memory, from 0 to 1; 0 where the kernel does not tell.
    pub pressure_memory: f32,
    /// The share of a processor that measuring and managing take themselves.
    pub cost: f32,
}

impl Load {
    /// The mean share of the processors that is at work, from 0 to 1; nothing where none is told.
    pub fn mean(&self) -> Option<f64> {
        let sum: f64 = self.processors.iter().map(|share| f64::from(*share)).sum();
        (!self.processors.is_empty()).then(|| sum / self.processors.len() as f64)
    }
}
