//! Derives for agents, parameters and messages.
